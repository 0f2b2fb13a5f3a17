"""Measurements of the cameras and of the service itself."""
