"""Endurance: memory and time of the tracker and of a camera pipeline over tens of thousands of frames.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.endurance --out out/bench

The tracker follows an endless synthetic crowd; people who leave never return, so tracks are initiated and
terminated all the time. The pipeline renders the synthetic room, encodes it, detects and tracks people.
Neither may grow.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.endurance.endless_crowd import crowd
from benchmarks.endurance.memory_samples import SPAN, MemorySamples
from benchmarks.paper_experiments.scene import HEIGHT, WIDTH
from tracking import CostSettings, OnlineTracker, WindowSettings, create_solver
from tracking.solvers.base import DEFAULT_SOLVER

_EVERY = 250
"""Frames between two samples."""
_OBJECTS_PER_SAMPLE = 4
"""Python objects of a sample: frames, megabytes, seconds, blocks."""
_MIN_FRAMES = 6 * _EVERY
"""Frames needed to measure growth: two samples in each third."""
_PEOPLE = 5
_SITE = {
    "site": {"name": "endurance", "fps": 25, "width": WIDTH, "height": HEIGHT},
    "cameras": [{"id": "c0", "source": "scene:room?camera=0&cameras=4&objects=4&seed=1"}],
}


@dataclass(slots=True)
class EnduranceRun:
    """The samples of a long run."""

    name: str
    samples: MemorySamples
    objects: int = 0
    """Number of ids assigned to objects."""


def run_tracker(frames: int) -> EnduranceRun:
    """Push frames of an endless crowd into a tracker."""
    tracker = OnlineTracker(WindowSettings(), CostSettings(), create_solver(DEFAULT_SOLVER))
    scene = crowd(_PEOPLE, seed=1)
    run = EnduranceRun("tracker", MemorySamples())

    def step(number: int) -> None:
        result = tracker.push(number, next(scene))
        if result is not None:
            run.objects = max([run.objects, *(track.id for track in result.tracks)])

    _repeat(run, frames, step)
    return run


def run_pipeline(frames: int) -> EnduranceRun:
    """Run frames through a camera's source, encoder, detector and tracker."""
    # Imported here: the tracker's memory is measured without the server's libraries.
    from server.camera.pipeline import CameraPipeline  # noqa: PLC0415
    from server.config.loader import build_config  # noqa: PLC0415

    pipeline = CameraPipeline(build_config(_SITE, where="endurance", folder=Path()), "c0")
    run = EnduranceRun("camera pipeline", MemorySamples())

    def step(number: int) -> None:
        frame = pipeline.take(number)
        if frame is not None:
            pipeline.encode(number, frame)
        tracks = pipeline.track(number, frame)
        if tracks is not None:
            run.objects = max([run.objects, *(track.id for track in tracks.tracks)])

    _repeat(run, frames, step)
    pipeline.close()
    return run


def _repeat(run: EnduranceRun, frames: int, step: Callable[[int], None]) -> None:
    for number in range(frames):
        step(number)
        if (number + 1) % _EVERY == 0:
            run.samples.add(number + 1)


def describe(report: Report, run: EnduranceRun) -> None:
    """Print a row for each span of frames, and the growth after the first span."""
    rows = []
    for start, stop in spans(run.samples.frames[-1]):
        part = run.samples.between(start, stop)
        middle = len(part.frames) // 2
        rows.append(
            [
                f"{start} to {part.frames[-1]}",
                f"{sorted(part.megabytes)[middle]:.1f}",
                f"{max(part.megabytes):.1f}",
                f"{sorted(part.blocks)[middle]}",
                f"{part.milliseconds_per_frame():.2f}",
            ]
        )
    columns = ["frames", "resident, median MB", "most, MB", "Python blocks, median", "processor ms per frame"]
    report.table(f"{run.name}: {run.samples.frames[-1]} frames, {run.objects} objects", columns, rows)
    settled = run.samples.between(min(SPAN, run.samples.frames[-1] // 3), run.samples.frames[-1])
    start = settled.frames[0] - _EVERY
    report.line(
        f"growth after the first {start} frames, in {SPAN}: {settled.growth():+.2f} MB,"
        f" {settled.block_growth():+.0f} blocks,"
        f" of which {_OBJECTS_PER_SAMPLE * SPAN // _EVERY} belong to the samples themselves"
    )


def spans(frames: int) -> Iterator[tuple[int, int]]:
    """Return the table's spans: :data:`SPAN` frames each, or a third of all frames if that is less."""
    span = min(SPAN, frames // 3)
    return itertools.pairwise(range(0, frames + 1, span))


def plot(runs: list[EnduranceRun], path: Path) -> None:
    """Draw the resident memory of each run."""
    figure = Figure(figsize=(9, 3.2 * len(runs)))
    axes = figure.subplots(len(runs), 1, squeeze=False)[:, 0]
    for axis, run in zip(axes, runs, strict=True):
        axis.plot(run.samples.frames, run.samples.megabytes, linewidth=1)
        axis.set(title=run.name, xlabel="frames", ylabel="resident memory, MB", ylim=(0, None))
        axis.grid(alpha=0.3)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "endurance")
    options.add_argument("--frames", type=int, default=50_000, help="for the tracker; 0: skip it")
    options.add_argument("--pipeline-frames", type=int, default=15_000, help="for the pipeline; 0: skip it")
    chosen = options.parse_args()
    report = Report()
    selected = ((run_tracker, chosen.frames), (run_pipeline, chosen.pipeline_frames))
    runs = []
    for run, frames in selected:
        if frames >= _MIN_FRAMES:
            runs.append(run(frames))
            describe(report, runs[-1])
    plot(runs, chosen.out / "endurance.png")
    report.save(chosen.out / "endurance.txt")


if __name__ == "__main__":
    main()
