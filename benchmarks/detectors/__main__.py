"""What finding people is worth: recall, precision and the ceiling of association, detector by detector.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.detectors --data ../shared/data --out out/bench

On recordings with ground truth, at an overlap (IoU) of one half. *Oracle* is the joint IDF1 over the cameras
of a scene when every box is given the true identity and boxes on nobody are left out: what association can
reach at most. Below each detector stand the tracks that the network program makes of its hypotheses. Where
there is no truth, pictures with the boxes drawn are saved. Times are processor time.

Other trackers (`benchmarks.other_trackers`, in a virtual environment of their own) get the same boxes: of
MyView's only the confident ones.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.detectors.annotated_pictures import save_pictures
from benchmarks.detectors.compared_detectors import OBSERVERS, SURE, ComparedDetector, DetectorRun, watch
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
SCENES = ("terrace", "pets09")
BY_EYE = "campus4"


@dataclass(frozen=True, slots=True)
class ScoreRow:
    """A row of the table: boxes of all views, scored."""

    name: str
    boxes: dict[str, list[MotRow]]
    tracks: bool
    ours: bool = True
    """MyView's tracks: the time to make them is known."""


def rows_of(
    observer: ComparedDetector, seen: dict[str, DetectorRun], peers: OtherTrackerEnvironment | None
) -> Iterator[ScoreRow]:
    """Yield the rows of one observer: its hypotheses, those it is sure of, and everybody's tracks of them.

    Raises:
        OtherTrackersUnavailableError: a peer failed.
    """
    hypotheses = {name: it.hypotheses for name, it in seen.items()}
    yield ScoreRow(observer.name, hypotheses, tracks=False)
    if observer is OBSERVERS[0]:
        sure = {name: [row for row in rows if row.confidence >= SURE] for name, rows in hypotheses.items()}
        hypotheses = sure
        yield ScoreRow(f"  score from {SURE:g}", sure, tracks=False)
    yield ScoreRow("  MyView's tracks", {name: it.tracks for name, it in seen.items()}, tracks=True)
    if peers is None or not observer.with_peers:
        return
    for peer in PEERS:
        if peer.name in TRACKERS:
            yield ScoreRow(f"  {peer.name}", peer_tracks(peers, peer, hypotheses), tracks=True, ours=False)


def peer_tracks(
    peers: OtherTrackerEnvironment, peer: OtherTracker, boxes: dict[str, list[MotRow]]
) -> dict[str, list[MotRow]]:
    """Return a peer's tracks of the boxes of every view."""
    tracks = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, rows in boxes.items():
            path = Path(folder) / f"{name}.txt"
            path.write_text(format_rows(rows), encoding="ascii")
            tracks[name] = peers.track(peer, path)
    return tracks


def measure_scene(
    report: Report, scene: str, options: argparse.Namespace, peers: OtherTrackerEnvironment | None
) -> None:
    """Print the table of a scene."""
    views = [view for view in views_of(options.data, scene) if view.truth]
    truths = {view.name: view.people(options.frames) for view in views}
    table: list[list[str]] = []
    for observer in OBSERVERS:
        if options.detector and not any(word in observer.name for word in options.detector):
            continue
        seen = {view.name: watch(observer, view, options.frames) for view in views}
        table += [_cells(row, truths, list(seen.values())) for row in rows_of(observer, seen, peers)]
    names = [f"{what} {view.name}" for view in views for what in ("rec.", "prec.")]
    columns = ["boxes", *names, "IDF1", "oracle", "ms", "frames/s"]
    rows, width, _ = next(views[0].images(1)).shape
    report.table(f"{scene}: {width}x{rows}, {_frames(views, options)} frames", columns, table)


def _cells(row: ScoreRow, truths: dict[str, list[MotRow]], seen: list[DetectorRun]) -> list[str]:
    """Return the cells of a row; of hypotheses the time to find them, of tracks that to make them as well."""
    scored: list[ViewScores] = [
        (scores_of_tracks if row.tracks else scores_of_boxes)(truth, row.boxes[name])
        for name, truth in truths.items()
    ]
    seconds = sum(it.detect_s + (it.track_s if row.tracks else 0.0) for it in seen)
    frames = sum(it.frames for it in seen)
    idf1 = f"{100 * sum(it.idf1 for it in scored) / len(scored):.0f}" if row.tracks else ""
    shares = [f"{share:.2f}" for it in scored for share in (it.recall, it.precision)]
    joint = f"{100 * oracle(truths, row.boxes):.0f}"
    times = [f"{1e3 * seconds / frames:.1f}", f"{frames / seconds:.0f}"] if row.ours else ["", ""]
    return [row.name, *shares, idf1, joint, *times]


def _frames(views: list[ScoredView], options: argparse.Namespace) -> str:
    counts = [sum(1 for _ in view.images(options.frames)) for view in views]
    return " and ".join(map(str, counts))


def measure(options: argparse.Namespace) -> None:
    """Run the comparison, print and save."""
    cv2.setNumThreads(1)
    report = Report()
    peers = None
    if not options.no_peers:
        try:
            peers = peer_environment(default_folder())
        except OtherTrackersUnavailableError as problem:
            report.say(f"without other trackers, which cannot be installed here: {problem}")
    for scene in options.scene or SCENES:
        measure_scene(report, scene, options, peers)
    report.say("IDF1: mean over the views. ms, frames/s: processor time per frame of one view, one core.")
    if not options.scene:
        try:
            for path in save_pictures(views_of(options.data, BY_EYE), options.out / "detectors"):
                report.say(f"by eye: {path}")
        except CannotRunError as problem:
            report.say(f"{BY_EYE}: left out: {problem}")
    report.save(options.out / "detectors.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "detectors")
    options.add_argument("--scene", action="append", choices=SCENES, help="only this one; may be repeated")
    options.add_argument("--detector", action="append", help="only those with this in their names")
    options.add_argument("--no-peers", action="store_true", help="leave out the other trackers")
    options.add_argument("--frames", type=int, help="only so many frames of each view")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "detectors")


if __name__ == "__main__":
    main()
