"""Scaling: many simulated cameras on one best-view process."""
