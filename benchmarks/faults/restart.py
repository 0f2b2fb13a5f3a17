"""From the death of the best-view service to the next picture, stage by stage.

    python -m benchmarks.faults.restart --out out/bench

`myview up` runs the site of :mod:`benchmarks.faults`; the best-view service is killed several times. Stages,
in seconds since the previous one, median and worst, and the median of the processor time that the new process
has used by then, which depends less on what else the machine does:

* *process*: the supervisor starts the service again;
* *page*: it has loaded, and its port answers;
* *frames*: cameras have connected, and pulses arrive;
* *decision*: a GOP is decided, whose look-ahead is 1 s;
* *picture*: a viewer has received one.
"""

from __future__ import annotations

import asyncio
import signal
import statistics
import tempfile
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path

import aiohttp

from benchmarks.common.environment import parser
from benchmarks.common.process_load import processor_seconds
from benchmarks.common.report import Report
from benchmarks.faults.site.fault_site import FaultSite, with_up
from benchmarks.faults.video.stamped_views import make

_PULSES = 10_000
_POLL_S = 0.02
_ANSWER_S = 0.5
_BACK_S = 60.0
_BETWEEN_S = 12.0
"""Seconds of running after which the supervisor restarts a process without backoff."""
STAGES = ("process", "page", "frames", "decision", "picture")
_FAILURES = (aiohttp.ClientError, OSError, TimeoutError)


@dataclass(frozen=True, slots=True)
class Stage:
    """A stage of a restart: seconds since the previous one, and processor seconds of the process so far."""

    name: str
    seconds: float
    processor_s: float


async def measure(times: int, folder: Path) -> list[list[Stage]]:
    """Kill the service so many times; return the stages of each restart.

    Raises:
        RuntimeError: the site does not recover.
    """
    views = await asyncio.to_thread(make, folder, _PULSES)
    async with with_up(views, folder) as site:
        runs = []
        for _ in range(times):
            await site.settle()
            await asyncio.sleep(_BETWEEN_S)
            runs.append(await _restart(site))
        return runs


async def _restart(site: FaultSite) -> list[Stage]:
    number = site.people(1)[0]
    old = site.pids("bestview")
    site.send(signal.SIGKILL, "bestview")
    last = time.monotonic()
    stages = []
    timeout = aiohttp.ClientTimeout(total=_ANSWER_S)
    async with aiohttp.ClientSession(site.url, timeout=timeout) as session:

        async def has_process() -> bool:
            return bool(set(site.pids("bestview")) - set(old))

        async def answers() -> bool:
            async with session.get("/healthz") as answer:
                return answer.ok

        async def metric(name: str) -> float:
            async with session.get("/metrics") as answer:
                lines = (await answer.text()).splitlines()
            return max(float(line.rpartition(" ")[2]) for line in lines if line.startswith(name))

        async def has_frames() -> bool:
            return await metric("myview_camera_live{") > 0 and await metric("myview_pulse ") >= 0

        async def has_decided() -> bool:
            return await metric("myview_decided_pulse ") > 0

        async def has_picture() -> bool:
            async with session.get(f"/objects/{number}/best.mp4") as answer:
                answer.raise_for_status()
                await answer.content.readuntil(b"moof")
                return True

        conditions = (has_process, answers, has_frames, has_decided, has_picture)
        for name, condition in zip(STAGES, conditions, strict=True):
            await _until(condition)
            now = time.monotonic()
            used = sum(map(processor_seconds, set(site.pids("bestview")) - set(old)))
            stages.append(Stage(name, now - last, used))
            last = now
    return stages


async def _until(condition: Callable[[], Awaitable[bool]]) -> None:
    deadline = time.monotonic() + _BACK_S
    while time.monotonic() < deadline:
        try:
            if await condition():
                return
        except (*_FAILURES, asyncio.IncompleteReadError):
            pass
        await asyncio.sleep(_POLL_S)
    raise RuntimeError(f"the best view has not recovered after {_BACK_S:g} s")


def main() -> None:
    """Read the command line, run, print."""
    options = parser(__doc__ or "", "faults.restart")
    options.add_argument("--times", type=int, default=5, help="how often the service is killed")
    chosen = options.parse_args()
    report = Report()
    with tempfile.TemporaryDirectory() as folder:
        runs = asyncio.run(measure(chosen.times, Path(folder)))
    rows = [
        [
            stages[0].name,
            f"{statistics.median(stage.seconds for stage in stages):.2f}",
            f"{max(stage.seconds for stage in stages):.2f}",
            f"{statistics.median(stage.processor_s for stage in stages):.2f}",
        ]
        for stages in zip(*runs, strict=True)
    ]
    totals = [sum(stage.seconds for stage in run) for run in runs]
    rows.append(["all", f"{statistics.median(totals):.2f}", f"{max(totals):.2f}", ""])
    report.table("restart of the best view, seconds", ["stage", "median", "worst", "processor"], rows)
    report.save(chosen.out / "restart.txt")


if __name__ == "__main__":
    main()
