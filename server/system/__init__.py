"""The operating system: files, processes, limits, clock, logs."""
