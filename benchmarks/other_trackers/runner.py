"""Runs another tracker on a file of detections, in the other trackers' own environment.

    python runner.py track NAME DETECTIONS TRACKS
    python runner.py score TRUTH TRACKS

Files are MOTChallenge text. It imports nothing of MyView, and MyView nothing of it. `score` prints the scores
of a TrackEval port, to check MyView's own.
"""

from __future__ import annotations

import gzip
import json
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

WINDOW = 20
"""Frames in a window of motile; neighboring windows share one."""

LEAST_IOU = 0.1
"""Overlap (IoU) from which motile may join boxes of two frames."""

Rows = np.ndarray[tuple[int, int], np.dtype[np.float64]]


def read(path: Path) -> Rows:
    """Return rows `frame, id, left, top, right, bottom, confidence`."""
    data = path.read_bytes()
    text = (gzip.decompress(data) if path.suffix == ".gz" else data).decode("ascii")
    rows = np.array(
        [[float(value) for value in line.split(",")[:7]] for line in text.splitlines() if line.strip()]
    )
    rows[:, 4:6] += rows[:, 2:4]
    return rows


def line(frame: int, number: int, box: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Format a row of tracks."""
    left, top, right, bottom = (float(side) for side in box)
    return f"{frame},{number},{left:.2f},{top:.2f},{right - left:.2f},{bottom - top:.2f},1,-1,-1,-1\n"


def online(kind: str) -> Callable[[Rows], Iterator[str]]:
    """Yield a tracker of Roboflow's `trackers`, with its own defaults."""
    import supervision  # noqa: PLC0415 — not in this process when motile runs
    import trackers  # noqa: PLC0415

    def run(rows: Rows) -> Iterator[str]:
        tracker = getattr(trackers, kind)()
        for frame in range(1, int(rows[:, 0].max()) + 1):
            here = rows[rows[:, 0] == frame]
            found = tracker.update(supervision.Detections(xyxy=here[:, 2:6], confidence=here[:, 6]))
            numbers = [] if found.tracker_id is None else found.tracker_id
            for box, number in zip(found.xyxy, numbers, strict=True):
                if number >= 0:  # -1: not confirmed
                    yield line(frame, int(number) + 1, box)

    return run


def windows(rows: Rows) -> Iterator[str]:
    """Yield the tracks of motile, window by window.

    The costs are chosen here: a box costs 0.5 minus its confidence, a track 1, and joining two boxes of
    neighboring frames 0.5 minus their overlap.
    """
    numbers: dict[int, int] = {}
    last = int(rows[:, 0].max())
    for start in range(1, max(last, 2), WINDOW - 1):
        frames = [np.flatnonzero(rows[:, 0] == frame) for frame in range(start, start + WINDOW)]
        if start > 1:  # the first of two windows decides their common frame
            frames[0] = np.array(
                [number for number in frames[0].tolist() if number in numbers], dtype=np.intp
            )
        for box, parent in linked(rows, frames):
            if box not in numbers:
                numbers[box] = numbers[parent] if parent is not None else max(numbers.values(), default=0) + 1
    for box in sorted(numbers):
        yield line(int(rows[box, 0]), numbers[box], rows[box, 2:6])


def linked(rows: Rows, frames: list[np.ndarray[Any, np.dtype[np.intp]]]) -> list[tuple[int, int | None]]:
    """Solve one window; return the selected boxes by frame, each with its predecessor."""
    import motile  # noqa: PLC0415 — only in its own process
    from motile import constraints, costs, variables  # noqa: PLC0415

    graph = motile.TrackGraph()
    for time, here in enumerate(frames):
        for box in here.tolist():
            graph.add_node(box, {"t": time, "score": float(rows[box, 6])})
    for before, after in pairwise(frames):
        for first, second in product(before.tolist(), after.tolist()):
            overlap = iou(rows[first, 2:6], rows[second, 2:6])
            if overlap >= LEAST_IOU:
                graph.add_edge((first, second), {"apart": 1.0 - overlap})
    if not graph.nodes:
        return []
    solver = motile.Solver(graph)
    solver.add_cost(costs.NodeSelectedCost(weight=-1.0, attribute="score", constant=0.5))
    solver.add_cost(costs.NodeAppearCost(constant=1.0))
    parents: dict[int, int] = {}
    if graph.edges:
        solver.add_cost(costs.EdgeSelectedCost(weight=1.0, attribute="apart", constant=-0.5))
        solver.add_constraint(constraints.MaxParents(1))
        solver.add_constraint(constraints.MaxChildren(1))
    chosen = solver.solve()
    if graph.edges:
        edges = solver.get_variables(variables.EdgeSelected)
        parents = {second: first for (first, second), index in edges.items() if chosen[index] > 0.5}
    nodes = solver.get_variables(variables.NodeSelected)
    taken = [box for box, index in nodes.items() if chosen[index] > 0.5]
    return [(box, parents.get(box)) for box in sorted(taken, key=lambda box: (rows[box, 0], box))]


def iou(first: np.ndarray[Any, Any], second: np.ndarray[Any, Any]) -> float:
    """Compute the intersection over union of two boxes."""
    sides = np.minimum(first[2:], second[2:]) - np.maximum(first[:2], second[:2])
    if sides.min() <= 0.0:
        return 0.0
    shared = float(np.prod(sides))
    return shared / (float(np.prod(first[2:] - first[:2]) + np.prod(second[2:] - second[:2])) - shared)


def own_scores(truth: Path, tracks: Path) -> dict[str, float]:
    """Compute the scores with the port of TrackEval."""
    from trackers.eval import evaluate_mot_sequence  # noqa: PLC0415 — only where it is needed

    found = evaluate_mot_sequence(truth, tracks, ["CLEAR", "HOTA", "Identity"])
    return {
        "hota": float(found.HOTA.HOTA),
        "mota": float(found.CLEAR.MOTA),
        "idf1": float(found.Identity.IDF1),
        "switches": float(found.CLEAR.IDSW),
    }


def main() -> None:
    """Run the command."""
    what, *words = sys.argv[1:]
    if what == "score":
        truth, tracks = map(Path, words)
        print(json.dumps(own_scores(truth, tracks)))
        return
    name, detections, out = words
    run = windows if name == "motile" else online(name)
    Path(out).write_text("".join(run(read(Path(detections)))), encoding="ascii")


if __name__ == "__main__":
    main()
