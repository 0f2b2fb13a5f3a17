"""Cameras placed from people who walk."""
