"""Soak test: a day of a whole site, its memory, descriptors, threads and delay."""
