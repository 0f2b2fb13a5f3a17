"""View selection: which camera shows each person, and why."""
