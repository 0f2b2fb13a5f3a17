"""The sliding-window dynamic program that selects a camera for each object (paper, section III)."""
