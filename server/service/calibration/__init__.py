"""Calibration from a walk, for the operator's page and the command line."""
