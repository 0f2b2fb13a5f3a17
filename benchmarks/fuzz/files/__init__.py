"""Files: configurations, calibrations, MOTChallenge files, recordings."""
