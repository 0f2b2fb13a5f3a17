"""The survey's comparison of trackers, with measurements in place of its words."""
