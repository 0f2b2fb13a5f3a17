"""Processes that a benchmark starts and ends: modules of Python, whose output goes to a log."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from typing import IO

from benchmarks.common.environment import ROOT, one_thread_environment

_EXIT_S = 15.0
"""Seconds in which a terminated process should exit."""


def start_module(log: IO[bytes], *arguments: str, **variables: str) -> subprocess.Popen[bytes]:
    """Start a module, the first of the arguments, with these environment variables, as if supervised."""
    environment = {**one_thread_environment(), "MYVIEW_SUPERVISED": "1", **variables}
    return subprocess.Popen(
        [sys.executable, "-m", *arguments], cwd=ROOT, env=environment, stdout=log, stderr=log
    )


def terminate(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Terminate processes; kill those that do not exit."""
    for process in processes:
        process.terminate()
    for process in processes:
        try:
            process.wait(_EXIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
