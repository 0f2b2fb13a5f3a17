"""Comparison with other trackers on public detections."""
