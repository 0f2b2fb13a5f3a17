"""Comparison of the solvers of the tracking program."""
