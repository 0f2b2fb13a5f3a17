"""Fuzzing of messages from the zenoh bus."""
