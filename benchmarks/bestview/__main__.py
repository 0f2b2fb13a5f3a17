"""Identities across cameras, and the best view of each person, against simpler methods and ground truth.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bestview --data ../shared/data --out out/bench

Joint IDF1 evaluates all cameras as one recording with common ids. View choices are scored as by `myview
evaluate --views`, compared with the exact offline optimum of the true visibility.

The ground truth replaces MyView's stages one after the other; the difference of two rows is the loss of a
stage: *true boxes* of visible people; *own boxes, true ids*: MyView's tracked boxes with the id of the person
in each, also with short gaps interpolated; *own tracklets, true ids*: each tracklet with the id of its most
frequent person; *own tracks, true ids*: likewise for whole tracks; *true ids by floor*: MyView's boxes with
true ids that only cameras of one calibrated floor share; *final ids*: MyView's final ids, known from the
start, with every person always present. The mean of *own tracks, not associated* is the score of the
single-camera trackers.

Detectors prescan recordings, as MyView does; with `--as-live` they learn the background on the fly.

*Appearance only* is association without travel times, for sites whose cameras share no floor.

*MyView* tracks people on the floor in all cameras at once; *per camera* in each alone (`track.joint`).

*Detected only* excludes views of people that the camera does not detect, although other cameras locate them.
*No peer evidence* is per camera, without detections from other cameras. *Calibrated* has the homographies
that `myview calibrate` computes from the cameras' tracks. *Largest* selects in each frame the camera with the
largest box. *Nearest feet* associates whole tracks of MyView's single-camera tracker (or ByteTrack's, on the
same boxes) by the median distance of foot points, and selects the largest box. *Occupancy map* detects people
on the ground from all cameras' foreground and links them by min-cost flow; MyView's program selects its
views. The sweeps use true boxes.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2

from benchmarks.bestview.association_baselines import own_tracks
from benchmarks.bestview.camera_tracks import SceneDetections, track_scene
from benchmarks.bestview.identity_errors import MatchedBoxes
from benchmarks.bestview.methods import (
    MIN_IOU,
    DetectedScene,
    MethodResult,
    MethodScores,
    run_methods,
    score_method,
)
from benchmarks.bestview.parameter_sweep import SweepResult, sweep, sweep_tables
from benchmarks.bestview.plots import plot_methods, plot_sweeps
from benchmarks.bestview.scenes import BenchmarkScene, auditorium, gallery, room, terrace
from benchmarks.bestview.track_calibration import CannotCalibrateError, calibrated
from benchmarks.bestview.visibility_losses import VisibilityLosses, losses
from benchmarks.common.environment import CannotRunError, parser
from benchmarks.common.report import Report
from benchmarks.other_trackers.virtual_environment import (
    OtherTrackerEnvironment,
    OtherTrackersUnavailableError,
    default_folder,
    peer_environment,
)

ROOMS = ((2, 3, 40.0), (4, 8, 40.0), (8, 20, 30.0))
"""Cameras, people, seconds."""
QUICK_ROOMS = ((2, 3, 12.0),)
SCENES = ("terrace", "auditorium", "room", "gallery")
ONE_ROOM = tuple(f"room-{cameras}-{people}" for cameras, people, _ in ROOMS)
GALLERY, QUICK_GALLERY = (6, 240.0), (3, 30.0)
"""People, seconds."""
COLUMNS = ["", "joint", "mean", "Agree", "Regret", "Visible", "Chosen", "Cuts", "Best", "Shot"]

LATER_S = (1.0, 15.0)
"""Time differences at which a camera's ids are compared with its earlier ones."""
IDENTITY_COLUMNS = [
    "",
    "recall",
    "precision",
    *(column for seconds in LATER_S for column in (f"{seconds:g} s: recall", "precision")),
]
LOSS_COLUMNS = ["", "Visible", "selection", "identity", "detection"]


def scenes(options: argparse.Namespace, folder: Path, report: Report) -> Iterator[BenchmarkScene]:
    """Yield the scenes one after the other; report those whose recordings are missing."""
    selected = options.scene or SCENES
    for name, find in (("terrace", terrace), ("auditorium", auditorium)):
        if name in selected:
            try:
                yield find(options.data)
            except CannotRunError as problem:
                report.line(f"{name}: skipped: {problem}")
    for cameras, people, seconds in QUICK_ROOMS if options.quick else ROOMS:
        if "room" in selected or f"room-{cameras}-{people}" in selected:
            yield room(folder, cameras, people, seconds)
    if "gallery" in selected:
        yield gallery(folder, *(QUICK_GALLERY if options.quick else GALLERY))


def as_live(scene: BenchmarkScene) -> BenchmarkScene:
    """Return the scene without prescan: nothing is known before its first frame."""
    return scene.with_detector({"prescan_s": 0})


def score_row(scores: MethodScores) -> list[str]:
    """Return a row of the main table: percent, cuts per minute, and the shortest shot in frames."""
    idf1 = (
        ["", ""]
        if scores.tracks is None
        else [f"{100 * score.idf1:.1f}" for score in (scores.tracks.joint, scores.tracks.mean)]
    )
    views = scores.views
    shares = (views.agreement, views.regret, views.visible, views.chosen)
    cuts = (views.cuts_per_minute, views.optimum_cuts_per_minute)
    return [
        scores.name,
        *idf1,
        *(f"{100 * share:.1f}" for share in shares),
        *(f"{cut:.1f}" for cut in cuts),
        str(views.shortest_shot or "-"),
    ]


def loss_row(name: str, losses: VisibilityLosses) -> list[str]:
    """Return a row of the table of visibility losses, percent."""
    return [
        name,
        *(
            f"{100 * share:.1f}"
            for share in (losses.visible, losses.selection, losses.identity, losses.detection)
        ),
    ]


def identity_row(scene: BenchmarkScene, result: MethodResult) -> list[str]:
    """Return a row of the table of identity errors, percent."""
    matched = MatchedBoxes.of(result.rendering.tracks, scene.gt, MIN_IOU)
    fps = float(scene.content["site"]["fps"])
    scores = (matched.across_cameras(), *(matched.over_time(round(seconds * fps)) for seconds in LATER_S))
    return [
        result.name,
        *(f"{100 * share:.1f}" for score in scores for share in (score.recall, score.precision)),
    ]


def find_other_trackers(options: argparse.Namespace, report: Report) -> OtherTrackerEnvironment | None:
    """Return the environment of the other trackers; report why if it cannot be created."""
    if options.no_peers or options.quick:
        return None
    try:
        return peer_environment(default_folder())
    except OtherTrackersUnavailableError as problem:
        report.line(f"other trackers are skipped, they cannot be installed: {problem}")
        return None


def self_calibrated_scene(
    scene: BenchmarkScene, uncalibrated_detections: SceneDetections, folder: Path, report: Report
) -> DetectedScene | None:
    """Return the scene calibrated from its cameras' tracks; report why if that fails."""
    try:
        calibrated_scene = calibrated(
            scene, own_tracks(track_scene(scene.config(ground=False), uncalibrated_detections.frames)), folder
        )
        return DetectedScene(calibrated_scene, calibrated_scene.detect())
    except CannotCalibrateError as problem:
        report.line(f"{scene.name}: not calibrated from its tracks: {problem}")
        return None


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    cv2.setNumThreads(1)
    report = Report()
    peers = find_other_trackers(options, report)
    scores: dict[str, list[MethodScores]] = {}
    swept: dict[str, list[SweepResult]] = {}
    with tempfile.TemporaryDirectory(prefix="myview-bestview-") as name:
        for full_scene in scenes(options, Path(name), report):
            scene = as_live(full_scene) if options.as_live else full_scene
            truth = scene.truth()
            detections = scene.detect()
            uncalibrated_detections = scene.detect(ground=False) if scene.calibrated else detections
            calibrated_scene = (
                None
                if options.quick
                else self_calibrated_scene(scene, uncalibrated_detections, Path(name), report)
            )
            results = list(
                run_methods(scene, truth, detections, uncalibrated_detections, peers, calibrated_scene)
            )
            scores[scene.name] = [score_method(scene, truth, result) for result in results]
            report.table(
                f"{scene.name}: {scene.about}",
                COLUMNS,
                [score_row(method_scores) for method_scores in scores[scene.name]],
            )
            identity_rows = [identity_row(scene, result) for result in results if not result.ground_truth]
            report.table(
                f"{scene.name}: identities, across cameras and over time", IDENTITY_COLUMNS, identity_rows
            )
            loss_rows = [
                (result.name, losses(scene, truth, result)) for result in results if not result.ground_truth
            ]
            report.table(
                f"{scene.name}: why people are not visible in the selected view",
                LOSS_COLUMNS,
                [loss_row(name, row) for name, row in loss_rows],
            )
            if not options.no_sweeps:
                swept[scene.name] = sweep(scene, truth, quick=options.quick)
    report.line(
        "joint, mean: IDF1. Cuts, Best: cuts per minute, selected and optimal. Shot: shortest, in frames."
    )
    report.line(
        "Identities: pairs of boxes in two cameras at the same time, or in one camera at a time difference. "
        "Recall: share of pairs of one person with one id; precision: of pairs with one id, of one person."
    )
    report.line(
        "Not visible in the selected view, but in another: selection, a camera that shows them has a box "
        "with their id; identity, only with another id; detection, no camera has a box on them."
    )
    sweep_tables(report, swept)
    report.save(options.out / "bestview.txt")
    plot_methods(scores, options.out / "bestview.png")
    if swept:
        plot_sweeps(swept, options.out / "bestview_sweeps.png")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "bestview")
    options.add_argument(
        "--scene", action="append", choices=SCENES + ONE_ROOM, help="only this one; may be repeated"
    )
    options.add_argument("--as-live", action="store_true", help="no prescan of recordings")
    options.add_argument("--quick", action="store_true", help="short synthetic scenes, no other trackers")
    options.add_argument("--no-peers", action="store_true", help="skip the other tracker")
    options.add_argument(
        "--no-sweeps", action="store_true", help="skip the sweeps of look-ahead, switch cost and GOP"
    )
    measure(options.parse_args())


if __name__ == "__main__":
    main()
