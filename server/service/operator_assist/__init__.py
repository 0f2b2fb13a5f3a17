"""The operator who helps: flags, and where somebody points."""
