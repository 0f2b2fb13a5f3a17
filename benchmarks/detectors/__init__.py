"""Comparison of detectors, and of the tracks made of their detections."""
