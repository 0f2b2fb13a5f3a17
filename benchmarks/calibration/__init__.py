"""Camera calibration from walking people."""
