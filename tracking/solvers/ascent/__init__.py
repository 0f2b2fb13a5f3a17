"""Dual ascent: prices that rise and fall along their slopes, for bounds and starting points."""
