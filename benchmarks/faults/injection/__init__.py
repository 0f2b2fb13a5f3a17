"""The faults, by what fails: processes, sources, messages, disk, clock, configuration."""
