"""Fuzzing of media: packets of cameras, splicing, files, and streams to clients."""
