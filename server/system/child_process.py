"""A process that the best-view service starts for what would keep it from its streams."""

from __future__ import annotations

import asyncio
import os
import sys

from server.system.niceness import lower_priority

_NICER = 5
"""Somebody waits for what it does, but everybody for the service; cameras yield to both (`site.niceness`)."""


async def start_child(module: str) -> asyncio.subprocess.Process:
    """Start a module as a process of its own; it is asked by its input, and answers by its output.

    Raises:
        OSError: the system does not let it start.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        process_group=0,  # Ctrl-C in a terminal is for the service alone
    )
    lower_priority(process.pid, _NICER)
    return process
