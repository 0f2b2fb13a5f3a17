"""The interface of the best-view service to HTTP: one class of queries and commands per subject."""
