"""Temporal consistency from above: who is mistaken after a merge, by window, and what pruning saves.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.temporal_consistency --out out/bench

Khalaf and Intille's Figs. 5 and 6 again, on 40 minutes of the drawn room `overhead` in which two to four
people meet, merge and part. As in theirs, the tracker is told who is where in the first picture, and nobody
comes or goes. Only one picture each half second is drawn, 320 pixels wide: nothing else is looked at. The
blobs are found once for all windows.

The drawn people wear what nobody takes for somebody else's. So the same is measured of the same pictures with
a quarter of their colour, which is all that people are told apart by.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import matplotlib as mpl
import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.temporal_consistency.blob_merges import events, merged, mistaken
from benchmarks.temporal_consistency.overhead_room import SIZE, BlobSequence, OverheadClip, played
from benchmarks.temporal_consistency.plots import THEIR_EDGES, THEIRS, plot
from tracking.baselines.temporal_consistency import TemporalSettings
from tracking.baselines.temporal_consistency.edge_search import cheapest_path_by_edges
from tracking.baselines.temporal_consistency.graph import (
    WindowGraph,
    count_joint_edges,
    count_unpruned_edges,
    prune_links,
)
from tracking.baselines.temporal_consistency.groups import solve_joint_path
from tracking.baselines.temporal_consistency.window import StageDecision, TemporalWindow

STAGES = (1, 2, 5, 10)
STAGE_S = 0.5
COLOURS = (1.0, 0.25)
"""Shares of the pictures' colour: all of it, and so little that clothes look alike."""
WAYS = ("every edge", "edges left by pruning", "person by person")
_TIMED_EVERY = 60
"""One window in so many is solved in all ways."""
_LEAST_MINUTES = 8.0
"""Half of one for each clip: whoever meets has parted by then."""


@dataclass(slots=True)
class MergeCounts:
    """What was counted of all clips with so many people.

    Attributes:
        merges: how many there were.
        chances: people in them, each of whom may be mistaken for somebody else afterwards.
        errors: how many were, by the stages of the window.
        edges: of each stage of the longest window, those that pruning leaves.
        unpruned: and all there would be.
        milliseconds: by way, what solving that window took.
    """

    merges: int = 0
    chances: int = 0
    errors: dict[int, int] = field(default_factory=lambda: dict.fromkeys(STAGES, 0))
    edges: list[int] = field(default_factory=list)
    unpruned: list[int] = field(default_factory=list)
    milliseconds: dict[str, list[float]] = field(default_factory=lambda: {way: [] for way in WAYS})


def clips(minutes: float) -> list[OverheadClip]:
    """Return sixteen sequences, so that many clothes meet: four of two people, six of three, six of four."""
    people = (2,) * 4 + (3,) * 6 + (4,) * 6
    return [OverheadClip(count, minutes / len(people), seed) for seed, count in enumerate(people)]


def follow(
    seen: BlobSequence, settings: TemporalSettings, tally: MergeCounts | None = None
) -> list[dict[int, int]]:
    """Return the blobs by number that a window decides on, stage by stage; count its edges into `tally`."""
    window = TemporalWindow(settings, SIZE, seen.metre, STAGE_S)
    first = dict(enumerate(seen.blobs[0].tolist(), start=1))
    window.begin(seen.stages[0], list(first.items()))
    told: list[StageDecision] = []
    for place, stage in enumerate(seen.stages[1:]):
        done = window.push(stage)
        if done is not None:
            told.append(done)
        if tally is not None and window.graph is not None:
            tally.edges.append(count_joint_edges(window.links)[-1])
            tally.unpruned.append(count_unpruned_edges(window.graph)[-1])
            if place % _TIMED_EVERY == 0:
                _time(window.graph, settings, tally)
    while (done := window.commit()) is not None:
        told.append(done)
    return [first, *(it.blob_by_id for it in told)]


def _time(graph: WindowGraph, settings: TemporalSettings, tally: MergeCounts) -> None:
    """Solve a window in all ways, from the costs of its steps on."""
    whole = replace(graph, max_step_cost=np.inf)
    solve: tuple[Callable[[], object], ...] = (
        lambda: cheapest_path_by_edges(prune_links(whole), graph.shared, graph.merge_cost),
        lambda: cheapest_path_by_edges(prune_links(graph), graph.shared, graph.merge_cost),
        lambda: solve_joint_path(graph, prune_links(graph), settings.max_joint_states),
    )
    for way, run in zip(WAYS, solve, strict=True):
        began = time.perf_counter()
        run()
        tally.milliseconds[way].append(1e3 * (time.perf_counter() - began))


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report, began = Report(), time.perf_counter()
    whole, pale = ({people: MergeCounts() for people in THEIRS} for _ in COLOURS)
    searching = []
    for clip in clips(options.minutes):
        for seen, tallies in zip(played(clip, STAGE_S, COLOURS), (whole, pale), strict=True):
            searching.append(1e3 * seen.seconds / len(seen.stages))
            count(seen, tallies[clip.people], edges_too=tallies is whole)
    print_errors(report, whole, "")
    print_errors(report, pale, f", {COLOURS[1]:.0%} of the colour left")
    print_edges(report, whole)
    report.say(
        f"{statistics.median(searching):.1f} ms a picture to find the blobs; "
        f"all of this took {time.perf_counter() - began:.0f} s"
    )
    plot(whole, pale, options.out / "temporal_consistency.png")
    report.save(options.out / "temporal_consistency.txt")


def count(seen: BlobSequence, tally: MergeCounts, *, edges_too: bool) -> None:
    """Count the merges of a clip, who is mistaken after them by each window, and the longest one's edges."""
    found = merged(seen.blobs)
    tally.merges += events(found, seen.blobs)
    tally.chances += len(found)
    for stages in STAGES:
        settings = TemporalSettings(window_stages=stages, stage_s=STAGE_S, closed_world=True)
        told = follow(seen, settings, tally if edges_too and stages == max(STAGES) else None)
        tally.errors[stages] += sum(mistaken(found, seen.blobs, told))


def print_errors(report: Report, tallies: dict[int, MergeCounts], how: str) -> None:
    """Print Fig. 5, theirs beside it."""
    rows = []
    for people, tally in tallies.items():
        errors = [str(it) for it in tally.errors.values()]
        rows.append([f"{people} people", str(tally.merges), str(tally.chances), *errors, _shares([tally])])
        theirs = [str(it) for it in THEIRS[people]]
        rows.append(["  theirs", theirs[0], "", *theirs[1:], _of([THEIRS[people]])])
    every = list(tallies.values())
    merges, chances = sum(it.merges for it in every), sum(it.chances for it in every)
    errors = [str(sum(it.errors[stages] for it in every)) for stages in STAGES]
    rows.append(["all", str(merges), str(chances), *errors, _shares(every)])
    theirs = [str(sum(column)) for column in zip(*THEIRS.values(), strict=True)]
    rows.append(["  theirs", theirs[0], "", *theirs[1:], _of(list(THEIRS.values()))])
    report.table(
        f"People who are somebody else after a merge, by the stages of the window (Fig. 5){how}",
        ["in the room", "merges", "people in them", *(f"{it} st." for it in STAGES), "in % of these"],
        rows,
    )


def _shares(tallies: Sequence[MergeCounts]) -> str:
    """Return the errors in hundredths of the people in merges."""
    chances = max(sum(it.chances for it in tallies), 1)
    return " ".join(f"{100 * sum(it.errors[stages] for it in tallies) / chances:.0f}" for stages in STAGES)


def _of(theirs: Sequence[tuple[int, ...]]) -> str:
    """Return their errors in hundredths of what they call merges."""
    merges, *errors = (sum(column) for column in zip(*theirs, strict=True))
    return " ".join(f"{100 * it / merges:.0f}" for it in errors)


def print_edges(report: Report, tallies: dict[int, MergeCounts]) -> None:
    """Print Fig. 6, theirs beside it, and what is saved."""
    rows = []
    for people, tally in tallies.items():
        least, most, mean = min(tally.edges), max(tally.edges), statistics.mean(tally.edges)
        pruned = 1 - sum(tally.edges) / sum(tally.unpruned)
        rows.append(
            [
                f"{people} people",
                *(str(least), str(most), f"{mean:.0f}", f"{100 * (1 - mean / most):.0f} %"),
                *(f"{statistics.mean(tally.unpruned):.0f}", f"{100 * pruned:.0f} %"),
            ]
        )
        least, most, mean = THEIR_EDGES[people]
        rows.append(
            ["  theirs", str(least), str(most), str(mean), f"{100 * (1 - mean / most):.0f} %", "", ""]
        )
    heads = ["least", "most", "mean", "mean below most", "mean of all", "pruned"]
    report.table(
        f"Edges a stage that pruning leaves, {max(STAGES)} stages (Fig. 6)", ["in the room", *heads], rows
    )
    report.table(
        f"Solving a window of {max(STAGES)} stages: ms, mean (and most) of one window in {_TIMED_EVERY}",
        ["in the room", *WAYS],
        [
            [f"{people} people", *(_time_of(it.milliseconds[way]) for way in WAYS)]
            for people, it in tallies.items()
        ],
    )


def _time_of(milliseconds: Sequence[float]) -> str:
    return f"{statistics.mean(milliseconds):.1f} ({max(milliseconds):.0f})" if milliseconds else ""


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "temporal_consistency")
    options.add_argument("--minutes", type=float, default=40.0, help="of all clips together")
    chosen = options.parse_args()
    if not _LEAST_MINUTES <= chosen.minutes < float("inf"):
        options.error(f"--minutes: {_LEAST_MINUTES:g} at least")
    measure(chosen)


if __name__ == "__main__":
    main()
