"""Fakes and helpers for tests of the `myview` commands."""
