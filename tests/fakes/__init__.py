"""What stands in for peers of the tested code, and helpers that several test files use."""
