"""Calibrating from a walk, on the operator's page and at the command line: words, plan and ground file."""
