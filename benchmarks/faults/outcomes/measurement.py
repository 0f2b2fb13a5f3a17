"""Runs faults one after the other, each in its kind of site."""

from __future__ import annotations

import asyncio
import itertools
import sys
from pathlib import Path

from benchmarks.common.environment import CannotRunError
from benchmarks.common.report import Report
from benchmarks.faults.outcomes import recording_check
from benchmarks.faults.outcomes.fault_run import FaultOutcome, run
from benchmarks.faults.site.fault_site import Fault
from benchmarks.faults.video.stamped_views import StampedViews, make
from client import ClientError

_LINES = 20
_PULSES = 15_000
"""Pulses with detections: ten minutes."""


async def measure(faults: list[Fault], folder: Path, report: Report) -> list[FaultOutcome]:
    """Run the faults one after the other."""
    views = await asyncio.to_thread(make, folder, _PULSES)
    outcomes: list[FaultOutcome] = []
    groups = itertools.groupby(faults, key=lambda fault: fault.standalone or fault.setup)
    for number, (_, group) in enumerate(groups):
        outcomes += await _run_group(list(group), views, folder / f"site-{number}", report)
    return outcomes


async def _run_group(
    faults: list[Fault], views: StampedViews, folder: Path, report: Report
) -> list[FaultOutcome]:
    await asyncio.to_thread(folder.mkdir)
    outcomes: list[FaultOutcome] = []
    try:
        if faults[0].standalone is not None:
            return [FaultOutcome(faults[0], exits=await faults[0].standalone(views, folder))]
        async with faults[0].setup(views, folder) as fault_site:
            for fault in faults:
                outcomes.append(await run(fault, fault_site, views))
                print(f"{fault.name}: done", file=sys.stderr, flush=True)
            exits = len(fault_site.exits)
        outcomes[-1].exits += fault_site.exits[exits:]  # of the site
        files = await asyncio.to_thread(recording_check.read, fault_site.recorded, fault_site.live)
        recording_check.add_recording_results(outcomes, fault_site.events, files)
    except CannotRunError as error:
        report.line(f"{faults[0].name}: skipped: {error}")
    except (ClientError, RuntimeError) as error:
        report.line(f"{faults[0].name} and the faults after it: {error}")
        report.line(await asyncio.to_thread(_last_log_lines, folder))
        outcomes += [FaultOutcome(fault, failed="the site did not run") for fault in faults[len(outcomes) :]]
    return outcomes


def _last_log_lines(folder: Path) -> str:
    """Return the last lines of the logs of a site's processes."""
    logs = [path.read_text(encoding="utf-8", errors="replace") for path in sorted(folder.glob("*.log"))]
    return "\n".join("".join(logs).splitlines()[-_LINES:])
