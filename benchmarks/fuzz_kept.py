"""What the service left on the disk: its recordings, and what was said of people by hand."""

from __future__ import annotations

from benchmarks.fuzz_kept_runs import Runs
from benchmarks.fuzz_kept_said import Said

TARGETS = (Runs, Said)
