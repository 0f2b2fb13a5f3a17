"""Time of view selection, and its growth."""
