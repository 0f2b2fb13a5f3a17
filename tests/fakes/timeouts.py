"""Timeouts of tests, far longer than anything takes, so that no test fails because a machine is slow."""

from __future__ import annotations

PATIENCE = 300.0
"""Seconds."""
PATIENCE_MS = 300_000
"""The same, milliseconds."""
