"""A day of a whole site in about an hour: does anything grow, does the delay stay?

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.soak --hours 24 --out out/bench

Runs `myview up` with all its processes on two small cameras, whose people are replaced all the time. Viewers,
readers of HLS and events, stalled viewers and viewers of the past come and go, and everything is recorded.

What is accelerated: the cameras were filmed at 3 frames a second, and the pulses come faster by `--speed`. So
every frame of the day is taken, encoded, searched, followed, decided and sent, and every GOP recorded, only
sooner. What the site keeps is counted in its own time: frames in memory, the recording, who is remembered.
What it is patient for (leases, late windows, visitors) stays as it is, for the machine is no faster.

Ends with exit code 1 when memory, descriptors, threads, tasks or the delay grew from the second quarter of
the time to the fourth (`benchmarks/soak/samples.py` has the bounds), a stream had a hole, or a process died.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import csv
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import aiohttp
import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.process_load import running_pids
from benchmarks.common.report import Report
from benchmarks.latency.running_site import LOG, running_site
from benchmarks.live_cameras.frame_counters import read_counts
from benchmarks.soak.accelerated_site import TimeScale, film
from benchmarks.soak.measurements import PROCESSES, LatencyMedians, SoakMeasurements
from benchmarks.soak.samples import ProcessSample, descriptors_of, resident_of, threads_of
from benchmarks.soak.soak_report import describe, plot
from benchmarks.soak.task_counts import hooked_environment, read_held
from benchmarks.soak.visitors import Visitors

_SEED = 1
_SAMPLES = 480
_LEAST_S = 2.0
"""Between two samples at least."""
_SETTLE_S = 10.0
_LATEST = 2.0
"""Of the time that it should take: after that it is given up."""
_KEPT = 0.125
"""Of the whole time: how long the recording is kept, so that it is full before the second quarter."""


class SiteBrokenError(Exception):
    """The site did not last; the text says why."""


async def soak(hours: float, tempo: TimeScale, folder: Path, out: Path) -> SoakMeasurements:
    """Run the site for so many hours of its time."""
    filmed = await asyncio.to_thread(film, folder / "films", tempo)
    notes, recorded = folder / "notes", folder / "recorded"
    notes.mkdir()
    settings = filmed.settings(recorded, _KEPT * hours)
    async with running_site(filmed, folder, hooked_environment(notes), settings) as site:
        await asyncio.sleep(_SETTLE_S)
        visitors = Visitors(site.url, tempo.fps, _SEED)
        soaked = SoakMeasurements(tempo, visitors)
        watching = asyncio.create_task(visitors.watch())
        began = time.monotonic()
        try:
            with (out / "soak.csv").open("w", encoding="ascii", newline="", buffering=1) as table:
                await _sample(soaked, hours, folder, csv.writer(table).writerow, watching)
        except SiteBrokenError as problem:
            soaked.broken = str(problem)
        finally:
            soaked.seconds = time.monotonic() - began
            with contextlib.suppress(OSError, aiohttp.ClientError):
                soaked.counts = await read_counts(site.url)
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)
    (out / "soak.log").write_bytes((folder / LOG).read_bytes())
    return soaked


async def _sample(
    soaked: SoakMeasurements,
    hours: float,
    folder: Path,
    write: Callable[[list[object]], object],
    watching: asyncio.Task[None],
) -> None:
    tempo, visitors = soaked.tempo, soaked.visitors
    expected = tempo.seconds(3600.0 * hours)
    every, give_up = max(_LEAST_S, expected / _SAMPLES), time.monotonic() + _LATEST * expected + 60.0
    pids = {name: running_pids(name) for name in PROCESSES}
    missing = [name for name, found in pids.items() if len(found) != 1]
    if missing:
        raise SiteBrokenError(f"not running: {', '.join(missing)}")
    write(["hours", "process", "resident_mb", "descriptors", "threads", "tasks", "blocks"])
    while visitors.camera.pulse < tempo.pulse(hours):
        await asyncio.wait({watching}, timeout=every)
        if watching.done():
            raise SiteBrokenError(f"the visitors ended: {watching.exception()!r}")
        if time.monotonic() > give_up:
            raise SiteBrokenError(f"it came no further than hour {tempo.hours(visitors.camera.pulse):.2f}")
        now, held = tempo.hours(visitors.camera.pulse), read_held(folder / "notes")
        for name, (pid,) in pids.items():
            noted = held.get(pid)
            try:
                sample = ProcessSample(
                    now,
                    resident_of(pid),
                    descriptors_of(pid),
                    threads_of(pid),
                    noted.tasks if noted else 0,
                    noted.blocks if noted else 0,
                )
            except OSError:
                raise SiteBrokenError(f"{name} died in hour {now:.2f}") from None
            soaked.samples[name].append(sample)
            numbers = (sample.descriptors, sample.threads, sample.tasks, sample.blocks)
            write([f"{now:.3f}", name, f"{sample.resident:.1f}", *numbers])
        _note_delay(soaked, now)
        soaked.recorded.append(await asyncio.to_thread(_megabytes, folder / "recorded"))


def _note_delay(soaked: SoakMeasurements, now: float) -> None:
    camera, person = (seen.delays for seen in (soaked.visitors.camera, soaked.visitors.person))
    soaked.delays.append(
        LatencyMedians(now, *(float(np.median(it)) if it else np.nan for it in (camera, person)))
    )
    camera.clear()
    person.clear()


def _megabytes(folder: Path) -> float:
    total = 0
    for file in folder.rglob("*"):
        with contextlib.suppress(OSError):  # retention has just taken it away
            total += file.stat().st_size
    return total / 1e6


def run(options: argparse.Namespace) -> bool:
    """Run, print and save; say whether everything stayed flat."""
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    tempo = TimeScale(options.speed)
    with tempfile.TemporaryDirectory(prefix="myview-soak-") as temporary:
        soaked = asyncio.run(soak(options.hours, tempo, Path(temporary), options.out))
    well = describe(report, soaked)
    if soaked.delays:
        plot(soaked, options.out / "soak.png")
    report.save(options.out / "soak.txt")
    return well


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "soak")
    options.add_argument("--hours", type=float, default=24.0, help="of the site's time")
    options.add_argument("--speed", type=float, default=22.0, help="times that the pulses are faster")
    sys.exit(0 if run(options.parse_args()) else 1)


if __name__ == "__main__":
    main()
