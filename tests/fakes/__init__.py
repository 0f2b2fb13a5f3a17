"""Fakes of the peers of the tested code, and helpers of several test files."""
