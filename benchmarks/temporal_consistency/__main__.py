"""Temporal consistency in an overhead view: identity errors after merges, and the effect of pruning.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.temporal_consistency --out out/bench

Repeats Khalaf and Intille's Figs. 5 and 6 on 40 minutes of the synthetic room `overhead`, in which two to
four people meet, merge and part. As in the paper, the tracker knows the identities in the first picture, and
nobody enters or leaves. One picture per half second is rendered, 320 pixels wide. Blobs are detected once for
all windows.

The people wear clearly different clothes. Since color is the only appearance feature, the measurements are
repeated with a quarter of the color saturation.
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
from benchmarks.temporal_consistency.blob_merges import count_merges, count_wrong_ids, find_merges
from benchmarks.temporal_consistency.overhead_room import SIZE, BlobSequence, OverheadClip, render_sequence
from benchmarks.temporal_consistency.plots import PUBLISHED, PUBLISHED_EDGES, plot
from tracking.baselines.temporal_consistency import TemporalSettings
from tracking.baselines.temporal_consistency.graph import (
    StageGraph,
    count_edges_without_pruning,
    count_joint_edges,
    prune_links,
)
from tracking.baselines.temporal_consistency.joint_path import cheapest_path_by_edges, solve_joint_path
from tracking.baselines.temporal_consistency.window import StageDecision, TemporalWindow

STAGES = (1, 2, 5, 10)
STAGE_S = 0.5
SATURATIONS = (1.0, 0.25)
"""Color saturations of the pictures: full, and low, at which clothes look similar."""
METHODS = ("all edges", "edges after pruning", "person by person")
_TIMED_EVERY = 60
"""One window in so many is solved with all methods."""
_MIN_MINUTES = 8.0
"""Half a minute for each clip: long enough for people to meet and part."""


@dataclass(slots=True)
class MergeCounts:
    """The counts of all clips with the same number of people.

    Attributes:
        merges: number of merges.
        chances: number of people in merges, each of whom may get a wrong id afterwards.
        errors: number of wrong ids, by stages of the window.
        edges: of the last stage of each longest window, after pruning.
        unpruned: edges without pruning.
        milliseconds: to solve the longest window, by method.
    """

    merges: int = 0
    chances: int = 0
    errors: dict[int, int] = field(default_factory=lambda: dict.fromkeys(STAGES, 0))
    edges: list[int] = field(default_factory=list)
    unpruned: list[int] = field(default_factory=list)
    milliseconds: dict[str, list[float]] = field(default_factory=lambda: {method: [] for method in METHODS})


def clips(minutes: float) -> list[OverheadClip]:
    """Return sixteen sequences with many pairs of clothes: four of two people, six of three, six of four."""
    people = (2,) * 4 + (3,) * 6 + (4,) * 6
    return [OverheadClip(count, minutes / len(people), seed) for seed, count in enumerate(people)]


def track_sequence(
    sequence: BlobSequence, settings: TemporalSettings, counts: MergeCounts | None = None
) -> list[dict[int, int]]:
    """Track with a window; return the blobs by id, stage by stage, and add its edges to `counts`."""
    window = TemporalWindow(settings, SIZE, sequence.pixels_per_meter, STAGE_S)
    first = dict(enumerate(sequence.blobs[0].tolist(), start=1))
    window.begin(sequence.stages[0], list(first.items()))
    tracked: list[StageDecision] = []
    for index, stage in enumerate(sequence.stages[1:]):
        decision = window.push(stage)
        if decision is not None:
            tracked.append(decision)
        if counts is not None and window.graph is not None:
            counts.edges.append(count_joint_edges(window.links)[-1])
            counts.unpruned.append(count_edges_without_pruning(window.graph)[-1])
            if index % _TIMED_EVERY == 0:
                _time(window.graph, settings, counts)
    while (decision := window.commit()) is not None:
        tracked.append(decision)
    return [first, *(decision.blob_by_id for decision in tracked)]


def _time(graph: StageGraph, settings: TemporalSettings, counts: MergeCounts) -> None:
    """Time all methods on a window whose step costs are known."""
    unpruned = replace(graph, max_step_cost=np.inf)
    solve: tuple[Callable[[], object], ...] = (
        lambda: cheapest_path_by_edges(prune_links(unpruned), graph.shared, graph.merge_cost),
        lambda: cheapest_path_by_edges(prune_links(graph), graph.shared, graph.merge_cost),
        lambda: solve_joint_path(graph, prune_links(graph), settings.max_joint_states),
    )
    for method, run in zip(METHODS, solve, strict=True):
        began = time.perf_counter()
        run()
        counts.milliseconds[method].append(1e3 * (time.perf_counter() - began))


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report, began = Report(), time.perf_counter()
    full_color, low_color = ({people: MergeCounts() for people in PUBLISHED} for _ in SATURATIONS)
    detect_ms = []
    for clip in clips(options.minutes):
        for sequence, tallies in zip(
            render_sequence(clip, STAGE_S, SATURATIONS), (full_color, low_color), strict=True
        ):
            detect_ms.append(1e3 * sequence.seconds / len(sequence.stages))
            add_counts(sequence, tallies[clip.people], with_edges=tallies is full_color)
    print_errors(report, full_color, "")
    print_errors(report, low_color, f", {SATURATIONS[1]:.0%} of the color saturation")
    print_edges(report, full_color)
    report.line(
        f"{statistics.median(detect_ms):.1f} ms per picture to detect the blobs; "
        f"{time.perf_counter() - began:.0f} s in total"
    )
    plot(full_color, low_color, options.out / "temporal_consistency.png")
    report.save(options.out / "temporal_consistency.txt")


def add_counts(sequence: BlobSequence, counts: MergeCounts, *, with_edges: bool) -> None:
    """Count the merges of a clip, identity errors after them by window, and the longest window's edges."""
    found = find_merges(sequence.blobs)
    counts.merges += count_merges(found, sequence.blobs)
    counts.chances += len(found)
    for stages in STAGES:
        settings = TemporalSettings(window_stages=stages, stage_s=STAGE_S, closed_world=True)
        tracked = track_sequence(sequence, settings, counts if with_edges and stages == max(STAGES) else None)
        counts.errors[stages] += sum(count_wrong_ids(found, sequence.blobs, tracked))


def print_errors(report: Report, tallies: dict[int, MergeCounts], pictures: str) -> None:
    """Print Fig. 5, with the published results."""
    rows = []
    for people, counts in tallies.items():
        errors = [str(error) for error in counts.errors.values()]
        rows.append([f"{people} people", str(counts.merges), str(counts.chances), *errors, _shares([counts])])
        published = [str(number) for number in PUBLISHED[people]]
        rows.append(["  published", published[0], "", *published[1:], _published_shares([PUBLISHED[people]])])
    all_counts = list(tallies.values())
    merges, chances = (
        sum(counts.merges for counts in all_counts),
        sum(counts.chances for counts in all_counts),
    )
    errors = [str(sum(counts.errors[stages] for counts in all_counts)) for stages in STAGES]
    rows.append(["all", str(merges), str(chances), *errors, _shares(all_counts)])
    published = [str(sum(column)) for column in zip(*PUBLISHED.values(), strict=True)]
    rows.append(
        ["  published", published[0], "", *published[1:], _published_shares(list(PUBLISHED.values()))]
    )
    report.table(
        f"Wrong identities after a merge, by the stages of the window (Fig. 5){pictures}",
        ["in the room", "merges", "people in them", *(f"{stages} st." for stages in STAGES), "in % of these"],
        rows,
    )


def _shares(tallies: Sequence[MergeCounts]) -> str:
    """Return the errors as percentages of the people in merges."""
    chances = max(sum(counts.chances for counts in tallies), 1)
    return " ".join(
        f"{100 * sum(counts.errors[stages] for counts in tallies) / chances:.0f}" for stages in STAGES
    )


def _published_shares(published: Sequence[tuple[int, ...]]) -> str:
    """Return the published errors as percentages of the published merges."""
    merges, *errors = (sum(column) for column in zip(*published, strict=True))
    return " ".join(f"{100 * error / merges:.0f}" for error in errors)


def print_edges(report: Report, tallies: dict[int, MergeCounts]) -> None:
    """Print Fig. 6, with the published results, and the savings of pruning."""
    rows = []
    for people, counts in tallies.items():
        least, most, mean = min(counts.edges), max(counts.edges), statistics.mean(counts.edges)
        pruned = 1 - sum(counts.edges) / sum(counts.unpruned)
        rows.append(
            [
                f"{people} people",
                *(str(least), str(most), f"{mean:.0f}", f"{100 * (1 - mean / most):.0f} %"),
                *(f"{statistics.mean(counts.unpruned):.0f}", f"{100 * pruned:.0f} %"),
            ]
        )
        least, most, mean = PUBLISHED_EDGES[people]
        rows.append(
            ["  published", str(least), str(most), str(mean), f"{100 * (1 - mean / most):.0f} %", "", ""]
        )
    heads = ["least", "most", "mean", "mean below most", "mean of all", "pruned"]
    report.table(
        f"Edges per stage after pruning, {max(STAGES)} stages (Fig. 6)", ["in the room", *heads], rows
    )
    report.table(
        f"Solving a window of {max(STAGES)} stages: ms, mean (and max.) of one in {_TIMED_EVERY} windows",
        ["in the room", *METHODS],
        [
            [f"{people} people", *(_mean_and_max(counts.milliseconds[method]) for method in METHODS)]
            for people, counts in tallies.items()
        ],
    )


def _mean_and_max(milliseconds: Sequence[float]) -> str:
    return f"{statistics.mean(milliseconds):.1f} ({max(milliseconds):.0f})" if milliseconds else ""


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "temporal_consistency")
    options.add_argument("--minutes", type=float, default=40.0, help="total length of the clips")
    chosen = options.parse_args()
    if not _MIN_MINUTES <= chosen.minutes < float("inf"):
        options.error(f"--minutes: at least {_MIN_MINUTES:g}")
    measure(chosen)


if __name__ == "__main__":
    main()
