"""A configuration with a mistake, read again by a running site: the old one stays, and the log says why."""

from __future__ import annotations

import asyncio
import os
import signal
from pathlib import Path

import yaml

from benchmarks.faults.site.fault_site import Fault, FaultSite, with_up
from benchmarks.latency.running_site import CONFIG, LOG

_MISTAKE = {"view": {"switch_cost_s": "banana"}}
_SAID = "view.switch_cost_s: Input should be a valid number"
_WITHIN_S = 5.0
_POLL_S = 0.05


async def mistaken(stand: FaultSite) -> None:
    """Write a mistake into the file, have it read again, and wait until the error is told; then mend it.

    Raises:
        RuntimeError: nobody says what is wrong, and where.
    """
    path, log = stand.folder / CONFIG, stand.folder / LOG
    good = await asyncio.to_thread(path.read_text, encoding="utf-8")
    already = await asyncio.to_thread(_times, log)
    bad = yaml.safe_dump({**yaml.safe_load(good), **_MISTAKE}, sort_keys=False)
    await asyncio.to_thread(path.write_text, bad, encoding="utf-8")
    try:
        os.kill(stand.main, signal.SIGHUP)
        async with asyncio.timeout(_WITHIN_S):
            while await asyncio.to_thread(_times, log) == already:  # noqa: ASYNC110 — a file of another process
                await asyncio.sleep(_POLL_S)
    except TimeoutError:
        raise RuntimeError(f"nobody said: {_SAID}") from None
    finally:
        await asyncio.to_thread(path.write_text, good, encoding="utf-8")
    os.kill(stand.main, signal.SIGHUP)


def _times(log: Path) -> int:
    return log.read_text(encoding="utf-8", errors="replace").count(_SAID)


FAULTS = (Fault("reload, one value wrong", with_up, mistaken),)
