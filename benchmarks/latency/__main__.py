"""Latency of `myview up` from the pulse to the frame shown in Chromium, by stage.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.latency --out out/bench

Three replayed views, all five processes and the browser on this machine, one viewer. The views are renderings
of the synthetic room, or a scene of the data folder (`--views campus4`).
"""

from __future__ import annotations

import argparse
import asyncio
import os
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.browser import check_chromium, chromium
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.recorded_views import ROOM, RecordedViews, find_or_draw
from benchmarks.common.report import Report
from benchmarks.latency.bus_subscriber import BusTimestamps, listening
from benchmarks.latency.running_site import log_of_failure, running_site
from benchmarks.latency.shown_frames import ShownFrames, watch_page
from benchmarks.latency.stage_delays import STAGES, StageDelays, split

_START_S = 15.0
"""Seconds of recording before the measurement: start, background model, first people."""
_SLOW = 95
_COLORS = ("#9ecae1", "#6baed6", "#3182bd", "#d9d9d9", "#fd8d3c", "#e6550d", "#74c476")


async def watch(
    views: RecordedViews, folder: Path, settle_s: float, seconds: float
) -> tuple[BusTimestamps, ShownFrames]:
    """Run the site, subscribe to its bus and watch its page.

    Raises:
        RuntimeError: the site does not start.
    """
    async with chromium() as browser, running_site(views, folder) as site:
        with listening(site.bus) as marks:
            shown = await watch_page(browser, site.url, settle_s, seconds)
        return marks, shown


def describe(report: Report, name: str, delays: StageDelays, shown: ShownFrames, shed: int) -> None:
    """Print the table."""
    declared = shown.lookahead / shown.fps
    rows = [_row(stage, delays.stages[:, place], what) for place, (stage, what) in enumerate(STAGES.items())]
    rows += [
        _row("total", delays.totals, "from due to shown"),
        [
            "declared",
            "",
            f"{1e3 * declared:.0f}",
            "",
            f"look-ahead: {shown.lookahead} frames at {shown.fps:g} a second",
        ],
        _row("excess", delays.totals - declared, "beyond the declared delay"),
    ]
    title = f"myview up on {name}: delay of {len(delays.pulses)} frames, ms"
    report.table(title, ["stage", "mean", "p50", "p95", "what"], rows)
    report.line(
        f"{delays.shown_share:.1%} of the frames were shown; {delays.unknown} with unknown stages left out"
    )
    report.line(f"decided without a late camera: {delays.late} of {delays.gops} GOPs")
    report.line(f"shed since the start: {shed} frames of all cameras")
    used = ", ".join(f"{who} {cores:.2f}" for who, cores in shown.cores.items())
    report.line(f"cores in use, of {os.cpu_count()}: {used}")


def _row(name: str, seconds: np.ndarray, what: str) -> list[str]:
    middle, late = np.percentile(seconds, [50, _SLOW])
    return [name, *(f"{1e3 * value:.0f}" for value in (seconds.mean(), middle, late)), what]


def plot(delays: StageDelays, shown: ShownFrames, path: Path, name: str) -> None:
    """Draw the mean delay by stage, of all and of the slowest frames, and the delay over time."""
    figure = Figure(figsize=(9, 5.5))
    bars, line = figure.subplots(2, 1, height_ratios=(3, 2))
    slow = delays.totals >= np.percentile(delays.totals, _SLOW)
    means = 1e3 * np.array([delays.stages.mean(axis=0), delays.stages[slow].mean(axis=0)])
    labels = ["all frames", f"slowest {100 - _SLOW} %"]
    left = np.zeros(len(labels))
    for place, stage in enumerate(STAGES):
        bars.barh(labels, means[:, place], left=left, color=_COLORS[place], label=stage, height=0.6)
        left += means[:, place]
    declared = 1e3 * shown.lookahead / shown.fps
    bars.axvline(declared, color="black", linestyle="--", linewidth=1, label="declared look-ahead")
    bars.invert_yaxis()
    bars.set(
        xlabel="ms from the pulse to the screen, mean of the frames", title=f"Delay of myview up on {name}"
    )
    bars.legend(ncols=4, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.22))
    line.plot((delays.pulses - delays.pulses[0]) / shown.fps, 1e3 * delays.totals, linewidth=0.8)
    line.axhline(declared, color="black", linestyle="--", linewidth=1)
    line.set(xlabel="seconds", ylabel="delay, ms", ylim=(0, None))
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    check_chromium()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="myview-delay-") as temporary:
        folder = Path(temporary)
        length = _START_S + options.settle + options.seconds
        views = find_or_draw(options.views, options.data, folder, length)
        report = Report()
        with log_of_failure(folder, report):
            marks, shown = asyncio.run(watch(views, folder, options.settle, options.seconds))
            delays = split(marks, shown)
    describe(report, views.name, delays, shown, marks.shed)
    plot(delays, shown, options.out / f"latency-{views.name}.png", views.name)
    report.save(options.out / f"latency-{views.name}.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "latency")
    options.add_argument("--views", default=ROOM, help="room, or a scene of the data folder")
    options.add_argument("--settle", type=float, default=10.0, help="seconds of playing before measuring")
    options.add_argument("--seconds", type=float, default=40.0, help="seconds to measure")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "latency")


if __name__ == "__main__":
    main()
