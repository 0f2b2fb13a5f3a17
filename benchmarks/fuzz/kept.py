"""What the service left on the disk: its recordings."""

from __future__ import annotations

from benchmarks.fuzz.kept_runs import Runs

TARGETS = (Runs,)
