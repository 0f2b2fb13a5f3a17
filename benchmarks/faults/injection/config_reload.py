"""Reload of an invalid configuration by a running site: the old one stays, and the log says why."""

from __future__ import annotations

import asyncio
import os
import signal
from pathlib import Path

import yaml

from benchmarks.faults.site.fault_site import Fault, FaultSite, with_up
from benchmarks.latency.running_site import CONFIG, LOG

_INVALID = {"view": {"switch_cost_s": "banana"}}
_ERROR = "view.switch_cost_s: Input should be a valid number"
_TIMEOUT_S = 5.0
_POLL_S = 0.05


async def reload_invalid_config(fault_site: FaultSite) -> None:
    """Write an invalid value, reload, wait until the error is logged, then restore the file.

    Raises:
        RuntimeError: the error is not logged.
    """
    path, log = fault_site.folder / CONFIG, fault_site.folder / LOG
    good = await asyncio.to_thread(path.read_text, encoding="utf-8")
    errors_before = await asyncio.to_thread(_count_errors, log)
    bad = yaml.safe_dump({**yaml.safe_load(good), **_INVALID}, sort_keys=False)
    await asyncio.to_thread(path.write_text, bad, encoding="utf-8")
    try:
        os.kill(fault_site.supervisor_pid, signal.SIGHUP)
        async with asyncio.timeout(_TIMEOUT_S):
            while await asyncio.to_thread(_count_errors, log) == errors_before:  # noqa: ASYNC110 — a file of another process
                await asyncio.sleep(_POLL_S)
    except TimeoutError:
        raise RuntimeError(f"not logged: {_ERROR}") from None
    finally:
        await asyncio.to_thread(path.write_text, good, encoding="utf-8")
    os.kill(fault_site.supervisor_pid, signal.SIGHUP)


def _count_errors(log: Path) -> int:
    return log.read_text(encoding="utf-8", errors="replace").count(_ERROR)


FAULTS = (Fault("reload, one value wrong", with_up, reload_invalid_config),)
