"""Fakes and helpers for tests of the HTTP server and client."""
