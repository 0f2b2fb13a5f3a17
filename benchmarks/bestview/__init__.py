"""Identities across cameras, and the best view of each person."""
