"""Soak test: a day of a whole site in about an hour; does memory, or the delay, grow?

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.soak --hours 24 --out out/bench

Runs `myview up` with all its processes on two small cameras, with ever new people. Viewers, HLS players,
readers of events, stalled viewers and viewers of recordings come and go, and everything is recorded.

The films have 3 frames a second, and pulses come `--speed` times faster. So every frame of the day is
captured, encoded, searched, tracked, decided and sent, and every GOP recorded, only sooner. Retention scales
with the site's time: frames in memory, the recording, remembered people. Timeouts (leases, late windows,
visitors) do not.

The exit code is 1 when memory, descriptors, threads, tasks or the delay grew from the second quarter of the
time to the fourth (bounds in `benchmarks/soak/samples.py`), a stream had a gap, or a process died.
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
from benchmarks.soak.task_counts import hooked_environment, read_object_counts
from benchmarks.soak.visitors import Visitors

_SEED = 1
_SAMPLES = 480
_LEAST_S = 2.0
"""Seconds between two samples at least."""
_SETTLE_S = 10.0
_LATEST = 2.0
"""Give up after so many times the expected time."""
_KEPT = 0.125
"""Retention of the recording, as a share of the whole time: full before the second quarter."""


class SiteBrokenError(Exception):
    """The site failed; the text says why."""


async def soak(hours: float, time_scale: TimeScale, folder: Path, out: Path) -> SoakMeasurements:
    """Run the site for so many hours of its time."""
    recordings = await asyncio.to_thread(film, folder / "films", time_scale)
    notes, recorded = folder / "notes", folder / "recorded"
    notes.mkdir()
    settings = recordings.settings(recorded, _KEPT * hours)
    async with running_site(recordings, folder, hooked_environment(notes), settings) as site:
        await asyncio.sleep(_SETTLE_S)
        visitors = Visitors(site.url, time_scale.fps, _SEED)
        measurements = SoakMeasurements(time_scale, visitors)
        watching = asyncio.create_task(visitors.watch())
        began = time.monotonic()
        try:
            with (out / "soak.csv").open("w", encoding="ascii", newline="", buffering=1) as table:
                await _sample(measurements, hours, folder, csv.writer(table).writerow, watching)
        except SiteBrokenError as problem:
            measurements.failure = str(problem)
        finally:
            measurements.seconds = time.monotonic() - began
            with contextlib.suppress(OSError, aiohttp.ClientError):
                measurements.counts = await read_counts(site.url)
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)
    (out / "soak.log").write_bytes((folder / LOG).read_bytes())
    return measurements


async def _sample(
    measurements: SoakMeasurements,
    hours: float,
    folder: Path,
    write: Callable[[list[object]], object],
    watching: asyncio.Task[None],
) -> None:
    time_scale, visitors = measurements.time_scale, measurements.visitors
    expected = time_scale.seconds(3600.0 * hours)
    every, give_up = max(_LEAST_S, expected / _SAMPLES), time.monotonic() + _LATEST * expected + 60.0
    pids = {name: running_pids(name) for name in PROCESSES}
    missing = [name for name, found in pids.items() if len(found) != 1]
    if missing:
        raise SiteBrokenError(f"not running: {', '.join(missing)}")
    write(["hours", "process", "resident_mb", "descriptors", "threads", "tasks", "blocks"])
    while visitors.camera.pulse < time_scale.pulse(hours):
        await asyncio.wait({watching}, timeout=every)
        if watching.done():
            raise SiteBrokenError(f"the visitors ended: {watching.exception()!r}")
        if time.monotonic() > give_up:
            raise SiteBrokenError(f"the site got stuck in hour {time_scale.hours(visitors.camera.pulse):.2f}")
        now, counts_by_pid = time_scale.hours(visitors.camera.pulse), read_object_counts(folder / "notes")
        for name, (pid,) in pids.items():
            counts = counts_by_pid.get(pid)
            try:
                sample = ProcessSample(
                    now,
                    resident_of(pid),
                    descriptors_of(pid),
                    threads_of(pid),
                    counts.tasks if counts else 0,
                    counts.blocks if counts else 0,
                )
            except OSError:
                raise SiteBrokenError(f"{name} died in hour {now:.2f}") from None
            measurements.samples[name].append(sample)
            numbers = (sample.descriptors, sample.threads, sample.tasks, sample.blocks)
            write([f"{now:.3f}", name, f"{sample.resident:.1f}", *numbers])
        _note_delay(measurements, now)
        measurements.recorded.append(await asyncio.to_thread(_megabytes, folder / "recorded"))


def _note_delay(measurements: SoakMeasurements, now: float) -> None:
    camera, person = (
        stream.delays for stream in (measurements.visitors.camera, measurements.visitors.person)
    )
    measurements.delays.append(
        LatencyMedians(now, *(float(np.median(delays)) if delays else np.nan for delays in (camera, person)))
    )
    camera.clear()
    person.clear()


def _megabytes(folder: Path) -> float:
    total = 0
    for file in folder.rglob("*"):
        with contextlib.suppress(OSError):  # retention has just removed it
            total += file.stat().st_size
    return total / 1e6


def run(options: argparse.Namespace) -> bool:
    """Run, print and save; return whether everything stayed flat."""
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    time_scale = TimeScale(options.speed)
    with tempfile.TemporaryDirectory(prefix="myview-soak-") as temporary:
        measurements = asyncio.run(soak(options.hours, time_scale, Path(temporary), options.out))
    passed = describe(report, measurements)
    if measurements.delays:
        plot(measurements, options.out / "soak.png")
    report.save(options.out / "soak.txt")
    return passed


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "soak")
    options.add_argument("--hours", type=float, default=24.0, help="of the site's time")
    options.add_argument("--speed", type=float, default=22.0, help="times that the pulses are faster")
    sys.exit(0 if run(options.parse_args()) else 1)


if __name__ == "__main__":
    main()
