"""The ways to a best view: MyView's, simpler ones, and MyView's with the truth in place of its stages."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.bestview.association_baselines import (
    boxes_by_truth,
    bridged,
    by_nearest_feet,
    not_joined,
    own_tracks,
    tracks_by_truth,
)
from benchmarks.bestview.camera_tracks import Rows, SceneDetections, followed
from benchmarks.bestview.occupancy.foreground_masks import CannotMapError
from benchmarks.bestview.occupancy.reference_tracker import occupancy_rows
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.bestview.service_decisions import Rendering, decide, decide_given, largest
from benchmarks.bestview.tracklet_cuts import own_parts
from benchmarks.other_trackers.virtual_environment import PEERS, OtherTrackerEnvironment
from bestview import ViewScore
from server.cli.evaluate.choices_file import Choice
from server.cli.evaluate.ground_truth import SceneTruth, people_of_objects
from server.cli.evaluate.view_scores import evaluate_views
from server.cli.render.site_file import SiteInfo
from server.service.view_selection.decider import camera_homographies
from tracking.evaluation import MultiCameraScores, TruthAndTracks, evaluate_cameras
from tracking.motchallenge import MotRow, format_rows

LEAST_IOU = 0.5
BRIDGE = 20
"""Frames that somebody may be hidden for and still count as shown."""
FOUND_ONLY = {"undetected_weight": 0.0}
LOOKS_ALONE = {"identity": {"maximum_travel_evidence": 0.0}}
TRUE, TRUE_LARGEST = "true boxes", "true boxes, largest"
OURS, CALIBRATED, WITHOUT = "MyView", "MyView, calibrated", "no homographies"
PEER = "ByteTrack"
MAP = "occupancy map"


@dataclass(frozen=True, slots=True)
class MethodResult:
    """One way's boxes by the person's number, and its choices."""

    name: str
    rendering: Rendering
    given: bool = False
    """Its boxes are the truth's: there is nothing to score in them."""


@dataclass(frozen=True, slots=True)
class MethodScores:
    """How good it is."""

    name: str
    tracks: MultiCameraScores | None
    views: ViewScore


def visible_rows(case: BenchmarkScene, truth: SceneTruth) -> dict[str, list[MotRow]]:
    """Return the true boxes of those who are visible: what a camera that misses nothing would find."""
    place = {person: index for index, person in enumerate(truth.people)}
    return {
        camera: [
            row
            for row in case.gt[camera]
            if row.confidence != 0.0 and truth.views.visible[place[row.id], row.frame - 1, column]
        ]
        for column, camera in enumerate(truth.cameras)
    }


@dataclass(frozen=True, slots=True)
class SearchedScene:
    """A scene as its cameras see it, whose search for people knows the ground.

    Attributes:
        case: the scene.
        watched: what they find.
    """

    case: BenchmarkScene
    watched: SceneDetections


def ways(
    case: BenchmarkScene,
    truth: SceneTruth,
    seen: SceneDetections,
    blind: SceneDetections,
    peers: OtherTrackerEnvironment | None,
    walked: SearchedScene | None,
) -> Iterator[MethodResult]:
    """Yield them, truth first.

    Args:
        case: the scene.
        truth: who could be seen in it.
        seen: what its cameras find.
        blind: the same where no homographies are known.
        peers: where the other tracker is installed.
        walked: the scene with the homographies of its own tracks.
    """
    frames = truth.boxes.shape[1]
    config = case.config()

    def chosen(rows: Rows) -> Rendering:
        return Rendering(_lists(rows), decide_given(config, rows, frames).choices)

    def simple(rows: Rows) -> Rendering:
        return Rendering(_lists(rows), largest(rows, case.sizes, frames))

    there = visible_rows(case, truth)
    yield MethodResult(TRUE, chosen(there), given=True)
    yield MethodResult(TRUE_LARGEST, simple(there), given=True)
    said = followed(config, seen.frames)
    own = own_tracks(said)
    named = boxes_by_truth(own, case.gt)
    yield MethodResult("own boxes, true ids", chosen(named))
    yield MethodResult("  and gaps bridged", chosen(bridged(named, BRIDGE)))
    yield MethodResult("own parts, true joins", chosen(tracks_by_truth(own_parts(config, said), case.gt)))
    yield MethodResult("own tracks, true joins", chosen(tracks_by_truth(own, case.gt)))
    yield MethodResult("own tracks, not joined", simple(not_joined(own)))
    uncalibrated = case.config(ground=False)
    bare_said = followed(uncalibrated, blind.frames)
    bare = decide(uncalibrated, bare_said)
    yield MethodResult(WITHOUT, bare)
    if case.apart:
        yield MethodResult("  looks alone", decide(case.config(ground=False, view=LOOKS_ALONE), bare_said))
    if not case.calibrated:
        yield MethodResult(f"{WITHOUT}, largest", simple(bare.tracks))
    for name, sight in ((OURS, SearchedScene(case, seen) if case.calibrated else None), (CALIBRATED, walked)):
        if sight is None:
            continue
        scene, found = sight.case, sight.watched
        said = said if scene is case else followed(scene.config(), found.frames)
        apart = followed(uncalibrated, found.frames)
        ours = decide(scene.config(), said)
        yield MethodResult(name, ours)
        yield MethodResult(f"{name}, found only", decide(scene.config(view=FOUND_ONLY), said))
        yield MethodResult(f"{name}, no evidence", decide(scene.config(), apart))
        if case.apart:
            yield MethodResult(f"{name}, looks alone", decide(scene.config(view=LOOKS_ALONE), said))
        yield MethodResult(f"{name}, again", chosen(ours.tracks))
        yield MethodResult(f"{name}, largest", simple(ours.tracks))
        ground = {camera: it for camera, it in camera_homographies(scene.config()).items() if it is not None}
        short = "nearest feet" if scene is case else "nearest feet, calibr."
        yield MethodResult(short, simple(by_nearest_feet(own_tracks(apart), ground)))
        if case.detections is None and not case.apart:
            title = MAP if scene is case else f"{MAP}, calibr."
            yield from (MethodResult(title, chosen(rows)) for rows in _mapped(scene, found))
        if peers is not None:
            theirs = by_nearest_feet(_peer_tracks(peers, found.boxes), ground)
            yield MethodResult(f"{PEER}, {short}", simple(theirs))


def _mapped(scene: BenchmarkScene, found: SceneDetections) -> Iterator[Rows]:
    """Yield what the occupancy map finds; where there can be none, say why."""
    try:
        yield occupancy_rows(scene, found.boxes)
    except CannotMapError as problem:
        print(f"{scene.name}: no occupancy map: {problem}")


def _lists(rows: Rows) -> dict[str, list[MotRow]]:
    return {camera: list(found) for camera, found in rows.items()}


def outcome(case: BenchmarkScene, truth: SceneTruth, way: MethodResult) -> MethodScores:
    """Score a way."""
    recordings = {camera: TruthAndTracks(case.gt[camera], way.rendering.tracks[camera]) for camera in case.gt}
    if way.given:
        scores, person_of = None, {person: person for person in truth.people}
    else:
        scores = evaluate_cameras(recordings, LEAST_IOU)
        person_of = people_of_objects(truth.people, recordings, LEAST_IOU)
    return MethodScores(way.name, scores, score_choices(case, truth, way.rendering.choices, person_of))


def score_choices(
    case: BenchmarkScene, truth: SceneTruth, choices: Sequence[Choice], person_of: Mapping[int, int]
) -> ViewScore:
    """Score choices against the truth, as `myview evaluate --views` does."""
    config = case.config()
    facts = SiteInfo(config.site.fps, config.view.switch_cost_s, case.sizes)
    return evaluate_views(truth, choices, person_of, facts).total


def _peer_tracks(peers: OtherTrackerEnvironment, boxes: Rows) -> dict[str, list[MotRow]]:
    """Return the peer's tracks of every camera's detections.

    Raises:
        OtherTrackersUnavailableError: it failed.
    """
    peer = next(it for it in PEERS if it.name == PEER)
    tracks = {}
    with tempfile.TemporaryDirectory() as folder:
        for camera, rows in boxes.items():
            path = Path(folder) / f"{camera}.txt"
            path.write_text(format_rows(rows), encoding="ascii")
            tracks[camera] = peers.track(peer, path)
    return tracks
