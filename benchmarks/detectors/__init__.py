"""What detectors find, and what the tracker makes of it."""
