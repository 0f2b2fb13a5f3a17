"""The trackers of the survey beside the network program, on the same pictures and the same detections.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.baselines --data ../shared/data --out out/bench

Every camera is searched once, as `myview track` does it, and what was found is given to each tracker, with
the pictures. All begin and end objects by the detections. `lp`, `kalman` and `track-graph` follow them by the
detections as well; the others by what pictures show, so that what they lose, or take a place in the
background for, is their own. Perfect association of the same detections is the ceiling. The time is the
tracker's alone.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib as mpl

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.other_trackers.plots import plot
from server.cli.track.command import DetectedFrame, config_for_video, detect_frames, final_rows
from tracking import CostSettings, WindowSettings, create_solver
from tracking.evaluation import HEADINGS, Scores, evaluate, format_scores, oracle_association
from tracking.motchallenge import MotRow, read_rows
from tracking.registry import PrescanTracker, create_tracker, tracker_names
from tracking.solvers import DEFAULT_SOLVER

CEILING = "perfect association"
_SHOWN = ("hota", "mota", "idf1", "recall", "precision", "switches", "tracks", "objects")
_AHEAD, _AHEAD_EVERY = 500, 20
_VIEWS = (("pets09", "view1", 7.0), ("terrace", "c0", 25.0), ("terrace", "c1", 25.0))
"""Scene, view, frames a second: what a file says of itself need not be what was filmed."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchedView:
    """One camera's frames with their detections, and the ground truth."""

    name: str
    frames: Sequence[DetectedFrame]
    truth: Sequence[MotRow]
    fps: float

    @property
    def detections(self) -> list[MotRow]:
        """All detections, as rows without a track."""
        return [
            MotRow(frame.number + 1, -1, box[0], box[1], box[2] - box[0], box[3] - box[1], score)
            for frame in self.frames
            for box, score in zip(
                frame.detections.boxes.tolist(), frame.detections.scores.tolist(), strict=True
            )
        ]


def views(data: Path, most: int | None) -> list[SearchedView]:
    """Detect people in the first `most` frames of every available view.

    Raises:
        CannotRunError: no view is available.
    """
    found = []
    for scene, name, rate in _VIEWS:
        video, truth = data / scene / f"{name}.mp4", data / scene / "gt" / f"{name}.txt"
        if video.is_file() and truth.is_file():
            frames = [
                frame
                for frame in detect_frames(config_for_video(video, None, None))
                if most is None or frame.number < most
            ]
            rows = [row for row in read_rows(truth) if row.frame <= len(frames)]
            found.append(SearchedView(f"{scene} {name}", frames, rows, rate))
    if not found:
        raise CannotRunError(f"needs pets09 or terrace in {data}; --data or MYVIEW_TEST_DATA say where")
    return found


def follow(name: str, view: SearchedView) -> tuple[list[MotRow], float]:
    """Return a tracker's tracks, and its milliseconds per frame."""
    frames = view.frames
    tracker = create_tracker(
        name, WindowSettings(), CostSettings(), lambda: create_solver(DEFAULT_SOLVER), fps=view.fps
    )
    if isinstance(tracker, PrescanTracker):  # as a recording is looked at ahead
        tracker.prepare(frame.image for frame in frames[:_AHEAD:_AHEAD_EVERY] if frame.image is not None)
    rows: list[MotRow] = []
    began = time.perf_counter()
    for frame in frames:
        rows += final_rows(tracker.push(frame.number, frame.detections, frame.image))
    rows += final_rows(tracker.flush())
    return rows, 1e3 * (time.perf_counter() - began) / len(frames)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report = Report()
    table: dict[str, dict[str, Scores]] = {}
    took: dict[str, list[float]] = {}
    for view in views(options.data, options.frames):
        found = table[view.name] = {}
        for name in tracker_names():
            rows, milliseconds = follow(name, view)
            found[name] = evaluate(view.truth, rows)
            took.setdefault(name, []).append(milliseconds)
        found[CEILING] = evaluate(view.truth, oracle_association(view.detections, view.truth))
        report.table(
            view.name,
            ["", *(HEADINGS[score] for score in _SHOWN)],
            [[name, *format_scores(scores, _SHOWN)] for name, scores in found.items()],
        )
    report.table(
        "What following takes: milliseconds a frame, the median of the views",
        ["", "ms"],
        [[name, f"{statistics.median(values):.1f}"] for name, values in took.items()],
    )
    plot(table, CEILING, options.out / "baselines.png")
    report.save(options.out / "baselines.txt")


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "baselines")
    options.add_argument("--frames", type=int, help="of each view at most")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "baselines")


if __name__ == "__main__":
    main()
