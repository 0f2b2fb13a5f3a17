"""A scene through the whole program: the run, and its scores against the truth."""
