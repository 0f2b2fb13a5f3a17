"""Seeded disturbances of a camera's pictures; `catalog.py` lists them with three strengths each."""
