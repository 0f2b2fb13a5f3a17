"""The survey's comparison of trackers with measurements for its words."""
