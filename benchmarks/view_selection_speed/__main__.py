"""Time of view selection, and its growth with people and cameras; a plot.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.view_selection_speed --out out/bench

The program alone runs on random costs, with every person visible to every camera. The whole decision runs the
best-view service's classes on simulated track messages, with people visible to some cameras. Times are
processor time of one thread, per frame of all cameras together.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.view_selection_speed.whole_decision import SimulatedCrowd, decision_times
from bestview import select_views

_PEOPLE, _CAMERAS, _AHEAD = 1000, 16, 25
_GOPS = (1, 5, 10, 25)
_MORE_PEOPLE = (30, 100, 300, 1000, 3000)
_MORE_CAMERAS = (2, 4, 8, 16, 32, 64)
_SEEN_BY = (1, 2, 4)
_SEED = 3
_SWITCH_COST = 7.5


@dataclass(frozen=True, slots=True)
class ProgramSize:
    """The size of a selection problem."""

    objects: int
    cameras: int
    lookahead: int
    gop: int
    min_shot_gops: int


def frame_time(size: ProgramSize, repeats: int) -> float:
    """Return the median seconds per frame; a choice is shared by all frames of a GOP."""
    rng = np.random.default_rng(_SEED)
    # The service's memory layout: objects innermost.
    cost = rng.random((size.lookahead, size.cameras, size.objects)).transpose(2, 0, 1)
    previous = rng.integers(0, size.cameras, size.objects)
    held = rng.integers(1, max(2, size.min_shot_gops), size.objects)
    starts = np.arange(size.lookahead) % size.gop == 0
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        select_views(cost, previous, _SWITCH_COST, starts, size.min_shot_gops, held, decided_gops=1)
        spent.append(time.process_time() - began)
    return float(np.median(spent)) / size.gop


def program_row(gop: int, repeats: int) -> list[str]:
    """Return a row: the program's times without and with a minimum shot of one second."""
    unconstrained = frame_time(ProgramSize(_PEOPLE, _CAMERAS, _AHEAD, gop, 0), repeats)
    with_min_shot = frame_time(ProgramSize(_PEOPLE, _CAMERAS, _AHEAD, gop, -(-25 // gop)), repeats)
    return [f"{gop}", f"{1e3 * unconstrained:.3f}", f"{1e3 * with_min_shot:.3f}"]


def decision_row(seen_by: int, gop: int, epochs: int, *, all_terms: bool) -> list[str]:
    """Return a row: the times of the stages of the whole decision."""
    spent = decision_times(SimulatedCrowd(_PEOPLE, _CAMERAS, seen_by), gop, epochs, all_terms=all_terms)
    stages = (
        spent.decoding,
        spent.quality,
        spent.costs,
        spent.selection,
        spent.decision,
        spent.people,
        spent.publishing,
    )
    return [
        f"{seen_by}",
        f"{gop}",
        "all" if all_terms else "default",
        *(f"{1e3 * stage:.2f}" for stage in stages),
    ]


def plot(report: dict[str, tuple[tuple[int, ...], list[float]]], path: Path) -> None:
    """Draw the growth of the program's time."""
    from matplotlib.figure import Figure  # noqa: PLC0415 — importing it earlier would count as the first row's time

    figure = Figure(figsize=(10, 4), layout="constrained")
    for axis, (label, (sizes, times)) in zip(figure.subplots(1, len(report)), report.items(), strict=True):
        axis.plot(sizes, [1e3 * value for value in times], marker="o", label="measured")
        proportional = [1e3 * times[-1] * size / sizes[-1] for size in sizes]
        axis.plot(sizes, proportional, linestyle=":", label="proportional to the last")
        axis.set(xlabel=label, ylabel="processor time per frame, ms", xscale="log", yscale="log")
        axis.legend()
    figure.suptitle(f"View selection: N = {_AHEAD}, GOP 10")
    figure.savefig(path, dpi=120)


def run(options: argparse.Namespace) -> None:
    """Print the tables and draw the plot."""
    report = Report()
    repeats = 5 if options.quick else 25
    report.table(
        f"The program for {_PEOPLE} objects, {_CAMERAS} cameras, N = {_AHEAD}; ms per frame",
        ["GOP", "no minimum shot", "minimum shot 1 s"],
        [program_row(gop, repeats) for gop in _GOPS],
    )
    people = [frame_time(ProgramSize(people, _CAMERAS, _AHEAD, 10, 0), repeats) for people in _MORE_PEOPLE]
    cameras = [frame_time(ProgramSize(_PEOPLE, count, _AHEAD, 10, 0), repeats) for count in _MORE_CAMERAS]
    report.table(
        "Growth, GOP 10; µs per frame",
        ["objects", "time", "cameras", "time"],
        [
            [*(row or ["", ""]), f"{count}", f"{1e6 * seconds:.0f}"]
            for row, count, seconds in zip_longest(
                [
                    [f"{count}", f"{1e6 * seconds:.0f}"]
                    for count, seconds in zip(_MORE_PEOPLE, people, strict=True)
                ],
                _MORE_CAMERAS,
                cameras,
            )
        ],
    )
    epochs = 8 if options.quick else 20
    rows = [decision_row(seen_by, 10, epochs, all_terms=False) for seen_by in _SEEN_BY]
    rows += [decision_row(2, 10, epochs, all_terms=True), decision_row(2, 1, epochs, all_terms=False)]
    report.table(
        f"The whole decision for {_PEOPLE} objects, {_CAMERAS} cameras; ms per frame",
        [
            "seen by",
            "GOP",
            "terms",
            "decoding",
            "quality",
            "costs",
            "selection",
            "decision",
            "identities",
            "publishing",
        ],
        rows,
    )
    report.line(
        "decision: decoding, quality, costs, selection and bookkeeping, from messages to selected views."
    )
    report.line(
        "Not included: identities (here given), and encoding of choices and boxes for files, bus and page."
    )
    options.out.mkdir(parents=True, exist_ok=True)
    plot(
        {"objects": (_MORE_PEOPLE, people), "cameras": (_MORE_CAMERAS, cameras)},
        options.out / "view_selection_speed.png",
    )
    report.save(options.out / "view_selection_speed.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "view_selection_speed")
    options.add_argument("--quick", action="store_true", help="fewer repeats")
    run(options.parse_args())


if __name__ == "__main__":
    main()
