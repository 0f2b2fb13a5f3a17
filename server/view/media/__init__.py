"""Containers and codecs, as far as streams are written by hand."""
