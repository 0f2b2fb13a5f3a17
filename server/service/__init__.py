"""The best-view service: line the cameras up, decide, splice."""
