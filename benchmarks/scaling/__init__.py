"""Many simulated cameras on one best-view process."""
