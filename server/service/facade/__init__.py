"""The best-view service as HTTP sees it: one class of queries and commands per subject."""
