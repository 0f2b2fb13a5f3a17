"""The trackers of the survey beside the network program, on the same pictures and the same detections.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.baselines --data ../shared/data --out out/bench

People are detected once per view, as in `myview track`; each tracker gets these detections and the pictures.
All trackers initiate and terminate objects by detections. `lp`, `kalman` and the track graphs also track
them by detections, `rjmcmc` by both, the others by appearance: they alone can drift onto the background.
Perfect association of the same detections is the upper bound. Times are the tracker's alone.
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
from server.cli.track.command import RecordedFrame, config_for_video, detect_frames, newly_final_rows
from tracking import CostSettings, WindowSettings, create_solver
from tracking.evaluation import HEADINGS, Scores, evaluate, format_scores, oracle_association
from tracking.motchallenge import MotRow, read_rows
from tracking.registry import PrescanTracker, create_tracker, tracker_names
from tracking.solvers import DEFAULT_SOLVER

CEILING = "perfect association"
_SHOWN = ("hota", "mota", "idf1", "recall", "precision", "switches", "tracks", "objects")
_PRESCAN_FRAMES, _PRESCAN_STEP = 500, 20
_VIEWS = (("pets09", "view1", 7.0), ("terrace", "c0", 25.0), ("terrace", "c1", 25.0))
"""Scene, view and true frame rate; the rate in a file can differ from it."""


@dataclass(frozen=True, slots=True, eq=False)
class DetectedView:
    """One camera's frames with their detections, and the ground truth."""

    name: str
    frames: Sequence[RecordedFrame]
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


def detect_views(data: Path, max_frames: int | None) -> list[DetectedView]:
    """Detect people in the first `max_frames` frames of every available view.

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
                if max_frames is None or frame.number < max_frames
            ]
            rows = [row for row in read_rows(truth) if row.frame <= len(frames)]
            found.append(DetectedView(f"{scene} {name}", frames, rows, rate))
    if not found:
        raise CannotRunError(f"needs pets09 or terrace in {data}; --data or MYVIEW_TEST_DATA give the folder")
    return found


def run_tracker(name: str, view: DetectedView) -> tuple[list[MotRow], float]:
    """Return a tracker's tracks, and its milliseconds per frame."""
    frames = view.frames
    tracker = create_tracker(
        name, WindowSettings(), CostSettings(), lambda: create_solver(DEFAULT_SOLVER), fps=view.fps
    )
    if isinstance(tracker, PrescanTracker):  # as `myview track` does
        tracker.prepare(
            frame.image for frame in frames[:_PRESCAN_FRAMES:_PRESCAN_STEP] if frame.image is not None
        )
    rows: list[MotRow] = []
    began = time.perf_counter()
    for frame in frames:
        rows += newly_final_rows(tracker.push(frame.number, frame.detections, frame.image))
    rows += newly_final_rows(tracker.flush())
    return rows, 1e3 * (time.perf_counter() - began) / len(frames)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report = Report()
    table: dict[str, dict[str, Scores]] = {}
    times: dict[str, list[float]] = {}
    for view in detect_views(options.data, options.frames):
        found = table[view.name] = {}
        for name in tracker_names():
            rows, milliseconds = run_tracker(name, view)
            found[name] = evaluate(view.truth, rows)
            times.setdefault(name, []).append(milliseconds)
        found[CEILING] = evaluate(view.truth, oracle_association(view.detections, view.truth))
        report.table(
            view.name,
            ["", *(HEADINGS[score] for score in _SHOWN)],
            [[name, *format_scores(scores, _SHOWN)] for name, scores in found.items()],
        )
    report.table(
        "Tracking time: milliseconds per frame, median over views",
        ["", "ms"],
        [[name, f"{statistics.median(values):.1f}"] for name, values in times.items()],
    )
    plot(table, CEILING, options.out / "baselines.png")
    report.save(options.out / "baselines.txt")


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "baselines")
    options.add_argument("--frames", type=int, help="maximum of each view")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "baselines")


if __name__ == "__main__":
    main()
