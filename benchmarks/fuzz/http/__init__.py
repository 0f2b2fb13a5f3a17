"""Fuzzing of HTTP requests to a served site."""
