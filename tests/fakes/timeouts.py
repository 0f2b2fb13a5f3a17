"""How long a test waits for something that it awaits, until it has failed.

Far longer than anything takes, so that no test fails because a machine is slow: only who fails waits so long.
"""

from __future__ import annotations

PATIENCE = 300.0
"""Seconds."""
PATIENCE_MS = 300_000
"""The same, for a browser."""
