"""The compared methods: MyView, simpler ones, and MyView with the ground truth in place of its stages."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.bestview.association_baselines import (
    apart_by_floor,
    boxes_by_truth,
    by_nearest_feet,
    interpolated_gaps,
    own_tracks,
    tracks_by_truth,
    unassociated_tracks,
)
from benchmarks.bestview.camera_tracks import Rows, SceneDetections, track_scene
from benchmarks.bestview.occupancy.foreground_masks import CannotMapError
from benchmarks.bestview.occupancy.reference_tracker import track_by_occupancy
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.bestview.service_decisions import Rendering, decide, decide_with_true_ids, largest
from benchmarks.bestview.tracklet_cuts import own_tracklets
from benchmarks.other_trackers.virtual_environment import PEERS, OtherTrackerEnvironment
from bestview import ViewScore
from server.cli.evaluate.choices_file import Choice
from server.cli.evaluate.ground_truth import SceneTruth, people_of_objects
from server.cli.evaluate.view_scores import evaluate_views
from server.cli.render.site_file import RenderedSite
from tracking.evaluation import MultiCameraScores, TruthAndTracks, evaluate_cameras
from tracking.motchallenge import MotRow, format_rows

MIN_IOU = 0.5
MAX_GAP = 20
"""Frames of a gap that is interpolated."""
DETECTED_ONLY = {"undetected_weight": 0.0}
PER_CAMERA = {"joint": False}
APPEARANCE_ONLY = {"identity": {"maximum_travel_evidence": 0.0}}
TRUE, TRUE_LARGEST = "true boxes", "true boxes, largest"
MYVIEW, CALIBRATED, UNCALIBRATED = "MyView", "MyView, calibrated", "no homographies"
PEER = "ByteTrack"
MAP = "occupancy map"


@dataclass(frozen=True, slots=True)
class MethodResult:
    """The tracks by person and the view choices of one method."""

    name: str
    rendering: Rendering
    ground_truth: bool = False
    """Whether the tracks are the ground truth, so that they are not scored."""


@dataclass(frozen=True, slots=True)
class MethodScores:
    """The scores of a method."""

    name: str
    tracks: MultiCameraScores | None
    views: ViewScore


def visible_rows(scene: BenchmarkScene, truth: SceneTruth) -> dict[str, list[MotRow]]:
    """Return the true boxes of visible people: the detections of a perfect camera."""
    place = {person: index for index, person in enumerate(truth.people)}
    return {
        camera: [
            row
            for row in scene.gt[camera]
            if row.confidence != 0.0 and truth.views.visible[place[row.id], row.frame - 1, column]
        ]
        for column, camera in enumerate(truth.cameras)
    }


@dataclass(frozen=True, slots=True)
class DetectedScene:
    """A calibrated scene with its detections.

    Attributes:
        scene: with homographies, which the detectors use.
        detections: of its cameras.
    """

    scene: BenchmarkScene
    detections: SceneDetections


@dataclass(frozen=True, slots=True)
class _Selection:
    """Views of a scene's people, selected from boxes with any ids."""

    scene: BenchmarkScene
    frames: int

    def best(self, rows: Rows) -> Rendering:
        """Return MyView's views."""
        config = self.scene.config(track=PER_CAMERA)
        return Rendering(_as_lists(rows), decide_with_true_ids(config, rows, self.frames).choices)

    def largest(self, rows: Rows) -> Rendering:
        """Return in each frame the camera with the largest box."""
        return Rendering(_as_lists(rows), largest(rows, self.scene.sizes, self.frames))


def run_methods(
    scene: BenchmarkScene,
    truth: SceneTruth,
    detections: SceneDetections,
    uncalibrated_detections: SceneDetections,
    peers: OtherTrackerEnvironment | None,
    self_calibrated: DetectedScene | None,
) -> Iterator[MethodResult]:
    """Run all methods, those with true boxes first.

    Args:
        scene: to run them on.
        truth: its ground truth.
        detections: of its cameras.
        uncalibrated_detections: the detections without homographies.
        peers: the environment of the other tracker.
        self_calibrated: the scene with homographies from its cameras' tracks.
    """
    selection = _Selection(scene, truth.boxes.shape[1])
    true_rows = visible_rows(scene, truth)
    yield MethodResult(TRUE, selection.best(true_rows), ground_truth=True)
    yield MethodResult(TRUE_LARGEST, selection.largest(true_rows), ground_truth=True)
    yield from _own_tracks(selection, detections)
    yield from _uncalibrated(selection, uncalibrated_detections)
    if scene.calibrated:
        yield from _calibrated(selection, DetectedScene(scene, detections), MYVIEW, "", peers)
    if self_calibrated is not None:
        yield from _calibrated(selection, self_calibrated, CALIBRATED, ", calibr.", peers)


def _own_tracks(selection: _Selection, detections: SceneDetections) -> Iterator[MethodResult]:
    """Each camera's own tracks, with true ids or with none."""
    scene = selection.scene
    config = scene.config(track=PER_CAMERA)
    messages = track_scene(config, detections.frames)
    own_rows = own_tracks(messages)
    true_ids = boxes_by_truth(own_rows, scene.gt)
    tracklets = tracks_by_truth(own_tracklets(config, messages), scene.gt)
    yield MethodResult("own boxes, true ids", selection.best(true_ids))
    yield MethodResult("  with gaps interpolated", selection.best(interpolated_gaps(true_ids, MAX_GAP)))
    yield MethodResult("own tracklets, true ids", selection.best(tracklets))
    yield MethodResult("own tracks, true ids", selection.best(tracks_by_truth(own_rows, scene.gt)))
    yield MethodResult("own tracks, not associated", selection.largest(unassociated_tracks(own_rows)))


def _uncalibrated(selection: _Selection, detections: SceneDetections) -> Iterator[MethodResult]:
    """MyView without homographies."""
    scene = selection.scene
    config = scene.config(ground=False)
    messages = track_scene(config, detections.frames)
    result = decide(config, messages)
    yield MethodResult(UNCALIBRATED, result)
    if scene.disjoint:
        by_appearance = scene.config(ground=False, view=APPEARANCE_ONLY)
        yield MethodResult("  appearance only", decide(by_appearance, messages))
    if not scene.calibrated:
        yield MethodResult(f"{UNCALIBRATED}, largest", selection.largest(result.tracks))


def _calibrated(
    selection: _Selection,
    detected: DetectedScene,
    name: str,
    suffix: str,
    peers: OtherTrackerEnvironment | None,
) -> Iterator[MethodResult]:
    """MyView and the other ways to associate, with homographies."""
    scene, found = detected.scene, detected.detections
    jointly, per_camera = scene.config(), scene.config(track=PER_CAMERA)
    messages = track_scene(jointly, found.frames)
    result = decide(jointly, messages)
    yield MethodResult(name, result)
    if jointly.joint_cameras and set(jointly.joint_cameras) != set(scene.gt):
        by_floor = apart_by_floor(boxes_by_truth(result.tracks, scene.gt), jointly.joint_cameras)
        yield MethodResult("  true ids by floor", selection.best(by_floor))
    yield MethodResult(f"{name}, detected only", decide(scene.config(view=DETECTED_ONLY), messages))
    without_peers = track_scene(selection.scene.config(ground=False), found.frames)
    yield MethodResult(f"{name}, per camera", decide(per_camera, track_scene(per_camera, found.frames)))
    yield MethodResult("  no peer evidence", decide(per_camera, without_peers))
    if scene.disjoint:
        by_appearance = scene.config(view=APPEARANCE_ONLY)
        yield MethodResult(f"{name}, appearance only", decide(by_appearance, messages))
    yield MethodResult(f"{name}, final ids", selection.best(result.tracks))
    yield MethodResult(f"{name}, largest", selection.largest(result.tracks))
    nearest = f"nearest feet{suffix}"
    feet = by_nearest_feet(own_tracks(without_peers), scene.homographies)
    yield MethodResult(nearest, selection.largest(feet))
    if scene.detections is None and not scene.disjoint:
        yield from (
            MethodResult(f"{MAP}{suffix}", selection.best(rows)) for rows in _occupancy_tracks(scene, found)
        )
    if peers is not None:
        other_tracks = by_nearest_feet(_peer_tracks(peers, found.boxes), scene.homographies)
        yield MethodResult(f"{PEER}, {nearest}", selection.largest(other_tracks))


def _occupancy_tracks(calibrated_scene: BenchmarkScene, found: SceneDetections) -> Iterator[Rows]:
    """Yield the tracks of the occupancy map; print why if it cannot be computed."""
    try:
        yield track_by_occupancy(calibrated_scene, found.boxes)
    except CannotMapError as problem:
        print(f"{calibrated_scene.name}: no occupancy map: {problem}")


def _as_lists(rows: Rows) -> dict[str, list[MotRow]]:
    return {camera: list(found) for camera, found in rows.items()}


def score_method(scene: BenchmarkScene, truth: SceneTruth, result: MethodResult) -> MethodScores:
    """Score the result of a method."""
    recordings = {
        camera: TruthAndTracks(scene.gt[camera], result.rendering.tracks[camera]) for camera in scene.gt
    }
    if result.ground_truth:
        scores, person_of = None, {person: person for person in truth.people}
    else:
        scores = evaluate_cameras(recordings, MIN_IOU)
        person_of = people_of_objects(truth.people, recordings, MIN_IOU)
    return MethodScores(result.name, scores, score_choices(scene, truth, result.rendering.choices, person_of))


def score_choices(
    scene: BenchmarkScene, truth: SceneTruth, choices: Sequence[Choice], person_of: Mapping[int, int]
) -> ViewScore:
    """Score choices against the truth, as `myview evaluate --views` does."""
    config = scene.config()
    facts = RenderedSite(config.site.fps, config.view.switch_cost_s, scene.sizes)
    return evaluate_views(truth, choices, person_of, facts).total


def _peer_tracks(peers: OtherTrackerEnvironment, boxes: Rows) -> dict[str, list[MotRow]]:
    """Return the peer's tracks of every camera's detections.

    Raises:
        OtherTrackersUnavailableError: the tracker failed.
    """
    peer = next(peer for peer in PEERS if peer.name == PEER)
    tracks = {}
    with tempfile.TemporaryDirectory() as folder:
        for camera, rows in boxes.items():
            path = Path(folder) / f"{camera}.txt"
            path.write_text(format_rows(rows), encoding="ascii")
            tracks[camera] = peers.track(peer, path)
    return tracks
