"""Real-time tracking of four live cameras (CIF, 25 frames a second), and its cost by stage.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.live_cameras --out out/bench

Runs a real site (`myview up`), all seven processes on this machine, on looped recordings or on the synthetic
room (`--views room`). Costs are processor time inside the real camera processes.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.process_load import OTHER, ProcessorUsage, read_processor_usage
from benchmarks.common.recorded_views import ROOM
from benchmarks.common.report import Report
from benchmarks.latency.bus_subscriber import BusTimestamps, listening
from benchmarks.latency.running_site import log_of_failure, running_site
from benchmarks.live_cameras.frame_counters import FrameCounts, read_counts
from benchmarks.live_cameras.looped_views import CAMERAS, CROWD, FPS, LoopedViews, live_views, usual_views
from benchmarks.live_cameras.stage_times import (
    REST,
    STAGES,
    CameraStageTimes,
    hooked_environment,
    read_stages,
)
from tracking.boxes import Floats

_OWN = "measuring"
_MS = 1e3
_WAITS = {
    "captured": "from when the pulse is due to the picture",
    "encoded": "the picture to H.264",
    "received": "over the bus",
    "solved": "from when a window's last frame is due until the window is solved",
}


@dataclass(frozen=True, slots=True)
class SiteSnapshot:
    """All counters of the site at one moment."""

    busy: ProcessorUsage
    counts: FrameCounts
    stages: Mapping[str, CameraStageTimes]


@dataclass(frozen=True, slots=True)
class LiveRun:
    """A measured run between two snapshots."""

    start: SiteSnapshot
    stop: SiteSnapshot
    marks: BusTimestamps
    first_pulse: int

    @property
    def milliseconds(self) -> dict[str, dict[str, float]]:
        """Processor milliseconds per frame by camera and stage."""
        return {
            camera: times.milliseconds_since(self.start.stages[camera])
            for camera, times in self.stop.stages.items()
        }

    @property
    def counts(self) -> FrameCounts:
        """The counts of the run."""
        return self.stop.counts.since(self.start.counts)

    @property
    def solved(self) -> Floats:
        """All cameras' windows, `(windows, 2)`: last pulse, and seconds from its due time to the solution."""
        due = {pulse: frame.due for (_, pulse), frame in self.marks.frames.items()}
        rows = [
            (last, at - due[last])
            for last, cameras in sorted(self.marks.solved.items())
            for at in cameras.values()
            if last in due and last >= self.first_pulse
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 2)


async def watch(live: LoopedViews, folder: Path, settle_s: float, seconds: float) -> LiveRun:
    """Run the site, and measure it after it has settled.

    Raises:
        RuntimeError: the cameras do not start in time.
    """
    times = folder / "stages"
    times.mkdir()

    async def moment() -> SiteSnapshot:
        return SiteSnapshot(read_processor_usage(), await read_counts(site.url), read_stages(times))

    async with running_site(live, folder, hooked_environment(times)) as site:
        with listening(site.bus) as marks:
            await asyncio.sleep(settle_s)
            start = await moment()
            first_pulse = max((pulse for _, pulse in marks.frames), default=0)
            await asyncio.sleep(seconds)
            stop = await moment()
    if not start.stages:
        raise RuntimeError("the cameras did not start in time; a longer --settle may help")
    return LiveRun(start, stop, marks, first_pulse)


def describe(report: Report, name: str, watched: LiveRun) -> None:
    """Print the tables, and whether tracking keeps up."""
    counts = watched.counts
    report.table(
        f"myview up, {CAMERAS} cameras of {name} at {FPS:g} a second: frames",
        ["camera", "received", "missed", "not searched", "bad messages"],
        [
            [
                camera,
                str(counts_of_camera["frames"]),
                str(counts_of_camera["missed"]),
                str(counts_of_camera["shed"]),
                str(counts_of_camera["bad_messages"]),
            ]
            for camera, counts_of_camera in counts.cameras.items()
        ],
    )
    _describe_stages(report, watched.milliseconds)
    _describe_waits(report, watched)
    cores = watched.stop.busy.cores_since(watched.start.busy)
    own = sum(used for who, used in cores.items() if who not in {OTHER, _OWN})
    report.line("cores in use: " + ", ".join(f"{who} {used:.2f}" for who, used in cores.items()))
    report.line(f"MyView's processes together: {own:.2f} cores of {os.cpu_count()}")
    keeps_up = "yes" if counts.dropped == 0 and counts.late == 0 else "NO"
    report.line(f"keeps up: {keeps_up}; frames dropped: {counts.dropped}, windows late: {counts.late}")


def _describe_stages(report: Report, used: Mapping[str, Mapping[str, float]]) -> None:
    names = {**STAGES, REST: "pulses, event loop, threads of the bus, thumbnails"}
    rows = [
        [stage, *(f"{used[camera][stage]:.2f}" for camera in used), _cores(used, [stage]), what]
        for stage, what in names.items()
    ]
    total = [f"{sum(used[camera].values()):.2f}" for camera in used]
    rows.append(["total", *total, _cores(used, list(names)), ""])
    report.table("processor ms per frame", ["stage", *used, "cores, all", "what"], rows)


def _cores(used: Mapping[str, Mapping[str, float]], stages: list[str]) -> str:
    return f"{FPS / _MS * sum(camera[stage] for camera in used.values() for stage in stages):.2f}"


def _describe_waits(report: Report, watched: LiveRun) -> None:
    frames = [frame for (_, pulse), frame in watched.marks.frames.items() if pulse >= watched.first_pulse]
    times = np.array(
        [(frame.due, frame.captured_at, frame.encoded, frame.received) for frame in frames]
    ).reshape(-1, 4)
    waits = [*np.diff(times, axis=1).T, watched.solved[:, 1]]
    rows = [
        [name, *(f"{_MS * value:.1f}" for value in np.percentile(wait, [50, 95, 100])), what]
        for (name, what), wait in zip(_WAITS.items(), waits, strict=True)
    ]
    report.table("wall-clock time, ms", ["stage", "p50", "p95", "max.", "what"], rows)


def plot(watched: LiveRun, name: str, path: Path) -> None:
    """Draw the cost of each stage, and the time to solve windows over time."""
    figure = Figure(figsize=(9, 6))
    bars, line = figure.subplots(2, 1)
    used = watched.milliseconds
    left = np.zeros(len(used))
    for stage in (*STAGES, REST):
        values = np.array([camera[stage] for camera in used.values()])
        bars.barh(list(used), values, left=left, label=stage, height=0.6)
        left += values
    bars.set(
        xlabel="processor ms per frame", title=f"myview up, {CAMERAS} cameras of {name} at {FPS:g} a second"
    )
    bars.axvline(_MS / FPS, color="black", linestyle="--", linewidth=1, label="one full core")
    bars.legend(ncols=5, fontsize="small")
    solved = watched.solved
    line.plot((solved[:, 0] - watched.first_pulse) / FPS, _MS * solved[:, 1], ".", markersize=3)
    line.set(xlabel="seconds", ylabel="time until a window is solved, ms", ylim=(0, None))
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    options.out.mkdir(parents=True, exist_ok=True)
    name = options.views or usual_views(options.data)
    with tempfile.TemporaryDirectory(prefix="myview-live-") as temporary:
        folder = Path(temporary)
        live = live_views(name, options.data, folder)
        report = Report()
        with log_of_failure(folder, report):
            watched = asyncio.run(watch(live, folder, options.settle, options.seconds))
    describe(report, name, watched)
    plot(watched, name, options.out / f"live_cameras-{name}.png")
    report.save(options.out / f"live_cameras-{name}.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "live_cameras")
    options.add_argument(
        "--views",
        choices=(CROWD, ROOM),
        help="recordings of the data folder or the scene; crowd where it is there",
    )
    options.add_argument("--settle", type=float, default=20.0, help="seconds before measuring")
    options.add_argument("--seconds", type=float, default=60.0, help="seconds to measure")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "live_cameras")


if __name__ == "__main__":
    main()
