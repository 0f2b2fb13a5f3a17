"""Fuzzing of files: configurations, calibrations, MOTChallenge files, recordings."""
