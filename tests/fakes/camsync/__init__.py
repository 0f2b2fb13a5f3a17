"""Fakes and helpers for tests of the pulse protocol."""
