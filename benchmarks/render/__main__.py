"""Speed of `myview render` on three recorded views, and its processor time by stage.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.render --data ../shared/data --out out/bench

First the command itself, with all its processes; then the same classes in one process, by stage. A frame is
one camera's picture. Times are processor time, which excludes other work on the machine, except for the wall
time.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import yaml

from benchmarks.common.environment import CannotRunError, finish, one_thread_environment, parser
from benchmarks.common.recorded_views import RecordedViews, find_views
from benchmarks.common.report import Report
from benchmarks.render.stage_times import STAGES, RenderStageTimes, time_stages


@dataclass(frozen=True, slots=True)
class RenderRun:
    """One run of the command."""

    frames: int
    """Frames of all cameras."""
    views: int
    fps: float
    """Frame rate of the recordings."""
    wall_s: float
    cpu_s: float
    """Processor time of all processes, including their start."""


def time_command(views: RecordedViews, config: Path, folder: Path) -> RenderRun:
    """Run `myview render` on the views into a new folder."""
    command = [sys.executable, "-m", "server.cli.main", "render", *map(str, views.videos)]
    command += ["--config", str(config), "--out", str(folder)]
    if views.ground is not None:
        command += ["--ground", str(views.ground)]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, env=one_thread_environment(), check=True, stdout=subprocess.DEVNULL)
    wall = time.perf_counter() - start
    # The command waits for its workers, so their time is included.
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return RenderRun(views.frames, len(views.videos), views.site["fps"], wall, cpu)


def describe(report: Report, name: str, run: RenderRun) -> None:
    """Print the table of the whole command."""
    frames, wall, cpu = run.frames, run.wall_s, run.cpu_s
    report.table(
        f"myview render on {name}: {run.views} views, {frames // run.views} frames each",
        ["", "", ""],
        [
            ["wall time", f"{wall:.1f}", "s"],
            ["processor time", f"{cpu:.1f}", "s, all processes, including their start"],
            ["cores used", f"{cpu / wall:.2f}", f"of {os.cpu_count()}, with other work on them"],
            ["frames per second", f"{frames / wall:.0f}", "all views together, wall time"],
            ["frames per second and core", f"{frames / cpu:.0f}", "by processor time"],
            [
                "times real time, per core",
                f"{frames / cpu / run.views / run.fps:.1f}",
                f"all views at {run.fps:g} a second",
            ],
        ],
    )


def describe_stages(report: Report, times: RenderStageTimes, whole_ms: float) -> None:
    """Print the table of stages; ``whole_ms`` is the command's processor time per frame."""
    total = sum(times.ms.values())
    rows = [
        [stage, f"{value:.2f}", f"{value / total:.0%}", STAGES[stage]] for stage, value in times.ms.items()
    ]
    rows += [
        ["all stages", f"{total:.2f}", "100%", "in one process"],
        [
            "the command",
            f"{whole_ms:.2f}",
            f"{whole_ms / total:.0%}",
            "rest: start, plots, other processes",
        ],
    ]
    report.table("Processor time per frame by stage", ["stage", "ms", "share", "what"], rows)


def plot(times: RenderStageTimes, path: Path, title: str) -> None:
    """Draw the stages as bars."""
    from matplotlib.figure import Figure  # noqa: PLC0415 — loading it would count as a stage's time

    figure = Figure(figsize=(7, 3.2))
    axis = figure.subplots()
    bars = axis.barh(list(times.ms), list(times.ms.values()), color="#3b7dd8")
    axis.bar_label(bars, fmt="%.2f", padding=3)
    axis.invert_yaxis()
    axis.margins(x=0.12)
    axis.set(xlabel="processor time per frame, ms", title=title)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def measure(options: argparse.Namespace) -> None:
    """Run both measurements, print and save."""
    views = find_views(options.data, options.views)
    report = Report()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="myview-render-") as folder:
        work = Path(folder)
        config = work / "views.yaml"
        content = {"site": views.site, "cameras": views.cameras, "detect": {"kind": "background"}}
        config.write_text(yaml.safe_dump(content), encoding="utf-8")
        run = time_command(views, config, work / "best")
        describe(report, views.name, run)
        times = time_stages(views, config, work / "stages")
    describe_stages(report, times, 1e3 * run.cpu_s / run.frames)
    plot(times, options.out / "render.png", f"myview render on {views.name}: {run.views} views")
    report.save(options.out / "render.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "render")
    options.add_argument("--views", default="campus4", help="which scene of the data folder")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "render")


if __name__ == "__main__":
    main()
