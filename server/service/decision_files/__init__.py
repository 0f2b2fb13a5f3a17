"""Decided tracks and view choices, written to files."""
