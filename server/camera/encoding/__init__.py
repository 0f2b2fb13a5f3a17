"""Encoding frames into closed GOPs."""
