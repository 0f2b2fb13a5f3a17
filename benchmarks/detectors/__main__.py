"""Comparison of detectors: recall, precision and the upper bound of association.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.detectors --data ../shared/data --out out/bench

On recordings with ground truth, at an overlap (IoU) of one half. *Oracle* is the joint IDF1 over the cameras
of a scene if every box has the true identity and false positives are dropped: the upper bound of association.
*AP* is the average precision, *cal.* the expected calibration error of the scores as probabilities that a box
is right; only scores of installed networks are meant as such (`benchmarks.detectors.score_calibration` fits
them).

Below each detector are the network program's tracks of its hypotheses. For scenes without ground truth,
pictures with drawn boxes are saved. Times are processor time.

Other trackers (`benchmarks.other_trackers`, in a separate virtual environment) get the same boxes, but of
MyView's only the confident ones.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2

from benchmarks.common.detection_scores import ScoredBoxes
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.detectors.annotated_pictures import save_pictures
from benchmarks.detectors.compared_detectors import (
    CONFIDENT,
    MYVIEW,
    ComparedDetector,
    DetectorRun,
    compared_detectors,
    run_detector,
)
from benchmarks.detectors.scored_views import (
    ScoredView,
    ViewScores,
    oracle,
    scores_of_boxes,
    scores_of_tracks,
    views_of,
)
from benchmarks.other_trackers.virtual_environment import (
    PEERS,
    OtherTracker,
    OtherTrackerEnvironment,
    OtherTrackersUnavailableError,
    default_folder,
    peer_environment,
)
from tracking.motchallenge import MotRow, format_rows

TRACKERS = ("SORT", "ByteTrack", "C-BIoU")
SCENES = ("terrace", "pets09", "terrace2")
INSPECTED = "campus4"


@dataclass(frozen=True, slots=True)
class ScoreRow:
    """A row of the table, with the scored boxes of all views."""

    name: str
    boxes: dict[str, list[MotRow]]
    tracks: bool
    timed: bool = True
    """Whether the time is measured: not that of other trackers."""


def rows_of(
    detector_spec: ComparedDetector,
    runs: dict[str, DetectorRun],
    other_trackers: OtherTrackerEnvironment | None,
) -> Iterator[ScoreRow]:
    """Yield the rows of one detector: its hypotheses, the confident ones, and all trackers' tracks of them.

    Raises:
        OtherTrackersUnavailableError: one of the other trackers failed.
    """
    hypotheses = {name: run.hypotheses for name, run in runs.items()}
    yield ScoreRow(detector_spec.name, hypotheses, tracks=False)
    if detector_spec.name == MYVIEW:
        confident = {
            name: [row for row in rows if row.confidence >= CONFIDENT] for name, rows in hypotheses.items()
        }
        hypotheses = confident
        yield ScoreRow(f"  score from {CONFIDENT:g}", confident, tracks=False)
    yield ScoreRow("  MyView's tracks", {name: run.tracks for name, run in runs.items()}, tracks=True)
    if other_trackers is None or not detector_spec.with_other_trackers:
        return
    for tracker in PEERS:
        if tracker.name in TRACKERS:
            yield ScoreRow(
                f"  {tracker.name}",
                tracks_of_tracker(other_trackers, tracker, hypotheses),
                tracks=True,
                timed=False,
            )


def tracks_of_tracker(
    other_trackers: OtherTrackerEnvironment, tracker: OtherTracker, boxes: dict[str, list[MotRow]]
) -> dict[str, list[MotRow]]:
    """Return another tracker's tracks of the boxes of every view."""
    tracks = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, rows in boxes.items():
            path = Path(folder) / f"{name}.txt"
            path.write_text(format_rows(rows), encoding="ascii")
            tracks[name] = other_trackers.track(tracker, path)
    return tracks


def measure_scene(
    report: Report, scene: str, options: argparse.Namespace, other_trackers: OtherTrackerEnvironment | None
) -> None:
    """Measure and print the table of a scene."""
    views = [view for view in views_of(options.data, scene) if view.truth]
    truths = {view.name: view.people(options.frames) for view in views}
    table: list[list[str]] = []
    for detector_spec in compared_detectors():
        if options.detector and not any(word in detector_spec.name for word in options.detector):
            continue
        runs = {view.name: run_detector(detector_spec, view, options.frames) for view in views}
        table += [
            _cells(row, truths, list(runs.values())) for row in rows_of(detector_spec, runs, other_trackers)
        ]
    names = [f"{score} {view.name}" for view in views for score in ("rec.", "prec.")]
    columns = ["boxes", *names, "AP", "cal.", "IDF1", "oracle", "ms", "frames/s"]
    rows, width, _ = next(views[0].images(1)).shape
    report.table(f"{scene}: {width}x{rows}, {_frames(views, options)} frames", columns, table)


def _cells(row: ScoreRow, truths: dict[str, list[MotRow]], runs: list[DetectorRun]) -> list[str]:
    """Return the cells of a row; the time of tracks includes that of their detection."""
    scored: list[ViewScores] = [
        (scores_of_tracks if row.tracks else scores_of_boxes)(truth, row.boxes[name])
        for name, truth in truths.items()
    ]
    seconds = sum(run.detect_s + (run.track_s if row.tracks else 0.0) for run in runs)
    frames = sum(run.frames for run in runs)
    idf1 = f"{100 * sum(view_scores.idf1 for view_scores in scored) / len(scored):.0f}" if row.tracks else ""
    shares = [
        f"{share:.2f}" for view_scores in scored for share in (view_scores.recall, view_scores.precision)
    ]
    joint = f"{100 * oracle(truths, row.boxes):.0f}"
    times = [f"{1e3 * seconds / frames:.1f}", f"{frames / seconds:.0f}"] if row.timed else ["", ""]
    boxes = ScoredBoxes.joined([ScoredBoxes.of(truth, row.boxes[name]) for name, truth in truths.items()])
    of_scores = [f"{boxes.average_precision:.2f}", f"{boxes.calibration_error:.3f}"]
    return [row.name, *shares, *(["", ""] if row.tracks else of_scores), idf1, joint, *times]


def _frames(views: list[ScoredView], options: argparse.Namespace) -> str:
    counts = [sum(1 for _ in view.images(options.frames)) for view in views]
    return " and ".join(map(str, counts))


def measure(options: argparse.Namespace) -> None:
    """Measure all scenes; print and save the tables."""
    cv2.setNumThreads(1)
    report = Report()
    other_trackers = None
    if not options.no_peers:
        try:
            other_trackers = peer_environment(default_folder())
        except OtherTrackersUnavailableError as problem:
            report.line(f"other trackers are skipped, they cannot be installed: {problem}")
    for scene in options.scene or SCENES:
        measure_scene(report, scene, options, other_trackers)
    report.line("IDF1: mean over the views. ms, frames/s: processor time per frame of one view, one core.")
    if not options.scene:
        try:
            for path in save_pictures(views_of(options.data, INSPECTED), options.out / "detectors"):
                report.line(f"for inspection: {path}")
        except CannotRunError as problem:
            report.line(f"{INSPECTED}: skipped: {problem}")
    report.save(options.out / "detectors.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "detectors")
    options.add_argument("--scene", action="append", choices=SCENES, help="only this one; may be repeated")
    options.add_argument(
        "--detector", action="append", help="only detectors whose name contains this; may be repeated"
    )
    options.add_argument("--no-peers", action="store_true", help="leave out the other trackers")
    options.add_argument("--frames", type=int, help="maximum of each view")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "detectors")


if __name__ == "__main__":
    main()
