"""What a viewer's choice of delay costs and gains: the delay on the page, and how good the views are.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.latency.delay_modes --out out/bench

One site of replayed views; the page is watched with each choice in turn. *Beyond* is the delay from
when a frame was due until Chromium showed it, without the look-ahead that was chosen. Regret and cuts are
those that the site measures of its own decisions (`/api/delays`).
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import aiohttp
import msgspec
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.common.browser import check_chromium, chromium
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.recorded_views import ROOM, RecordedViews, find_or_draw
from benchmarks.common.report import Report
from benchmarks.latency.bus_subscriber import listening
from benchmarks.latency.running_site import log_of_failure, running_site
from benchmarks.latency.shown_frames import watch_page
from server.service.facade.streams import ViewerDelay
from server.service.view_selection.delay_modes import DelayMode

_START_S = 15.0
"""Seconds of recording before the measurement: start, background model, first people."""
_PERCENTILES = 50, 95
_COLORS = ("#e6550d", "#3182bd", "#31a354")


@dataclass(frozen=True, slots=True, eq=False)
class WatchedDelay:
    """What the page showed with a choice of delay.

    Attributes:
        mode: the choice.
        seconds: (frames,) from when each shown frame was due until it was shown.
        declared: the site's own figures.
        cores: cores in use by all processes.
    """

    mode: DelayMode
    seconds: NDArray[np.float64]
    declared: ViewerDelay
    cores: float


async def watch_modes(
    views: RecordedViews, folder: Path, settle_s: float, seconds: float
) -> Sequence[WatchedDelay]:
    """Run the site, and watch its page with each delay for some seconds.

    Raises:
        RuntimeError: the site does not start.
    """
    watched = []
    async with chromium() as browser, running_site(views, folder) as site:
        with listening(site.bus) as marks:
            for mode in DelayMode:
                shown = await watch_page(browser, f"{site.url}?delay={mode}", settle_s, seconds)
                due = {pulse: frame.due for (_, pulse), frame in marks.frames.items()}
                delays = [at - due[pulse] for pulse, at in shown.at.items() if pulse in due]
                declared = (await _delays(site.url))[mode]
                watched.append(WatchedDelay(mode, np.array(delays), declared, sum(shown.cores.values())))
    return watched


async def _delays(url: str) -> dict[str, ViewerDelay]:
    async with aiohttp.ClientSession() as session, session.get(f"{url}api/delays") as answer:
        content = msgspec.json.decode(await answer.read())
    rows = msgspec.convert(content["delays"], list[ViewerDelay])
    return {row.delay: row for row in rows}


def describe(report: Report, name: str, watched: Sequence[WatchedDelay]) -> None:
    """Print the table."""
    rows = []
    for row in watched:
        shown, ahead = row.declared, row.declared.lookahead_s
        total = np.percentile(row.seconds, _PERCENTILES)
        rows.append(
            [
                str(row.mode),
                f"{1e3 * ahead:.0f}",
                *(f"{1e3 * value:.0f}" for value in (*total, *(total - ahead))),
                *(
                    "" if value is None else f"{value:.2f}"
                    for value in (shown.regret_s, shown.cuts_per_minute)
                ),
                f"{len(row.seconds)}",
                f"{row.cores:.2f}",
            ]
        )
    columns = ["delay", "look-ahead, ms", "p50", "p95", "beyond p50", "p95", "regret, s/min", "cuts/min"]
    report.table(f"{name}: choices of delay, ms", [*columns, "frames", "cores"], rows)


def plot(watched: Sequence[WatchedDelay], path: Path, name: str) -> None:
    """Draw the distribution of each choice's delay."""
    figure = Figure(figsize=(8, 4))
    axes = figure.subplots()
    for row, color in zip(watched, _COLORS, strict=True):
        ordered = np.sort(row.seconds)
        axes.plot(1e3 * ordered, np.linspace(0, 100, len(ordered)), color=color, label=str(row.mode))
        axes.axvline(1e3 * row.declared.lookahead_s, color=color, linestyle="--", linewidth=1)
    axes.set(xlabel="ms from the pulse to the screen (dashed: look-ahead)", ylabel="% of the frames")
    axes.set(title=f"Choices of delay on {name}", xlim=(0, None))
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    check_chromium()
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    with tempfile.TemporaryDirectory(prefix="myview-delays-") as temporary:
        folder = Path(temporary)
        length = _START_S + len(DelayMode) * (options.settle + options.seconds + 5.0)
        views = find_or_draw(options.views, options.data, folder, length)
        with log_of_failure(folder, report):
            watched = asyncio.run(watch_modes(views, folder, options.settle, options.seconds))
    describe(report, views.name, watched)
    plot(watched, options.out / f"delay-modes-{views.name}.png", views.name)
    report.save(options.out / f"delay-modes-{views.name}.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "latency.delay_modes")
    options.add_argument("--views", default=ROOM, help="room, or a scene of the data folder")
    options.add_argument("--settle", type=float, default=15.0, help="seconds of playing before measuring")
    options.add_argument("--seconds", type=float, default=40.0, help="seconds to measure each choice")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "latency.delay_modes")


if __name__ == "__main__":
    main()
