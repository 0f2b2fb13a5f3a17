"""Viewers of a site under fault, and the check of every picture that they received."""
