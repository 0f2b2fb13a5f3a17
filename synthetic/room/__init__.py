"""Rooms with furniture: geometry and surfaces."""
