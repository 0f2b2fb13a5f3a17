"""MyView beside other trackers, on public detections."""
