"""Which camera shows whom, and why."""
