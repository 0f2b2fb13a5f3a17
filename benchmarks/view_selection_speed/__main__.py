"""Time of view selection, and its growth with people and cameras; a plot.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.view_selection_speed --out out/bench

The program alone runs on random costs, with every person in every camera's view. The whole decision runs the
best-view service's own classes on simulated track messages of people in view of some cameras. Times are
processor time of one thread, per frame of all cameras together.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.view_selection_speed.selection_program import ProgramSize, frame_time
from benchmarks.view_selection_speed.whole_decision import SimulatedCrowd, decision_times

_PEOPLE, _CAMERAS, _AHEAD = 1000, 16, 25
_GOPS = (1, 5, 10, 25)
_MORE_PEOPLE = (30, 100, 300, 1000, 3000)
_MORE_CAMERAS = (2, 4, 8, 16, 32, 64)
_SEEN_BY = (1, 2, 4)


def program_row(gop: int, repeats: int) -> list[str]:
    """Return a row: the program at the promised size, without and with a minimum shot of a second."""
    free = frame_time(ProgramSize(_PEOPLE, _CAMERAS, _AHEAD, gop, 0), repeats)
    kept = frame_time(ProgramSize(_PEOPLE, _CAMERAS, _AHEAD, gop, -(-25 // gop)), repeats)
    return [f"{gop}", f"{1e3 * free:.3f}", f"{1e3 * kept:.3f}"]


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
    from matplotlib.figure import Figure  # noqa: PLC0415 — loading it would count as the first row's time

    figure = Figure(figsize=(10, 4), layout="constrained")
    for axis, (label, (sizes, times)) in zip(figure.subplots(1, len(report)), report.items(), strict=True):
        axis.plot(sizes, [1e3 * value for value in times], marker="o", label="measured")
        straight = [1e3 * times[-1] * size / sizes[-1] for size in sizes]
        axis.plot(sizes, straight, linestyle=":", label="proportional to the last")
        axis.set(xlabel=label, ylabel="processor time a frame, ms", xscale="log", yscale="log")
        axis.legend()
    figure.suptitle(f"View selection: N = {_AHEAD}, GOP 10")
    figure.savefig(path, dpi=120)


def run(options: argparse.Namespace) -> None:
    """Print the tables and draw the plot."""
    report = Report()
    repeats = 5 if options.quick else 25
    report.table(
        f"The program for {_PEOPLE} objects, {_CAMERAS} cameras, N = {_AHEAD}; ms a frame",
        ["GOP", "free", "shots of a second"],
        [program_row(gop, repeats) for gop in _GOPS],
    )
    people = [frame_time(ProgramSize(people, _CAMERAS, _AHEAD, 10, 0), repeats) for people in _MORE_PEOPLE]
    cameras = [frame_time(ProgramSize(_PEOPLE, count, _AHEAD, 10, 0), repeats) for count in _MORE_CAMERAS]
    report.table(
        "Growth, GOP 10; µs a frame",
        ["objects", "time", "cameras", "time"],
        [
            [f"{k}" if k else "", f"{1e6 * s:.0f}" if k else "", f"{c}", f"{1e6 * t:.0f}"]
            for (k, s), (c, t) in zip(
                [*zip(_MORE_PEOPLE, people, strict=True), (0, 0.0)],
                zip(_MORE_CAMERAS, cameras, strict=True),
                strict=True,
            )
        ],
    )
    epochs = 8 if options.quick else 20
    rows = [decision_row(seen_by, 10, epochs, all_terms=False) for seen_by in _SEEN_BY]
    rows += [decision_row(2, 10, epochs, all_terms=True), decision_row(2, 1, epochs, all_terms=False)]
    report.table(
        f"The whole decision for {_PEOPLE} objects, {_CAMERAS} cameras; ms a frame",
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
    report.line("Besides: identities (here by given ids), and encoding choices and boxes")
    report.line("for the files, the bus and the page.")
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
