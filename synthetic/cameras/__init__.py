"""Cameras of a drawn scene: projection, sensor noise, visibility."""
