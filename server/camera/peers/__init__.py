"""Detections exchanged with the other cameras of a site."""
