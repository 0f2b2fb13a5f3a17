"""Overload: more cameras than the machine carries, what is shed, and the recovery."""
