"""The people who have an id: assignment, re-identification, corrections."""
