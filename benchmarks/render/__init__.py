"""Rendering speed of recordings, and processor time by stage."""
