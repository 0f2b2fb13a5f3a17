"""A day of a whole site: memory, descriptors, threads, delay."""
