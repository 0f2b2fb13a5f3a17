"""Fakes and helpers for tests of the best-view service."""
