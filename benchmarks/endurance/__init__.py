"""Endurance: memory and time over many frames."""
