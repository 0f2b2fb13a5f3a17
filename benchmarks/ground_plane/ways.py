"""The compared ways: tracked jointly, per camera and joined afterwards, and frame by frame."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from benchmarks.bestview.association_baselines import by_nearest_feet, own_tracks, unassociated_tracks
from benchmarks.bestview.camera_tracks import Rows, SceneDetections, track_scene
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.bestview.service_decisions import decide
from benchmarks.ground_plane.frame_by_frame import track_frame_by_frame
from benchmarks.ground_plane.stages import timed_stages
from tracking import Detections, create_solver
from tracking.evaluation import MultiCameraScores, TruthAndTracks, evaluate_cameras
from tracking.ground_plane import (
    GroundCamera,
    GroundFrame,
    GroundPlaneTracker,
    GroundSettings,
    track_ground_plane,
)
from tracking.ground_plane.places.measurements import estimate_units_per_meter
from tracking.motchallenge import MotRow

MIN_IOU = 0.5
JOINT, SERVED, JOINED, NEAREST, ALONE, BY_FRAME = (
    "joint program",
    "joint program in the service",
    "per camera, joined",
    "per camera, nearest feet",
    "per camera alone",
    "frame by frame",
)


@dataclass(frozen=True, slots=True)
class WayScore:
    """The scores of one way on one scene."""

    way: str
    scores: MultiCameraScores
    ms: float
    """Processor time per frame of all cameras, without detection."""
    stages: Mapping[str, float]
    """The same by stage, where it is known."""


def run_ways(
    scene: BenchmarkScene, detections: SceneDetections, ways: list[str], solver: str
) -> Iterator[WayScore]:
    """Run the selected ways on a scene."""
    config = scene.config(track={"joint": False})
    length = max(len(found.detections) for found in detections.frames.values())
    homographies = scene.homographies
    cameras = {
        camera: GroundCamera(homography, *detections.frames[camera].size)
        for camera, homography in homographies.items()
    }
    frames = [
        {
            camera: found.detections[index]
            for camera, found in detections.frames.items()
            if index < len(found.detections)
        }
        for index in range(length)
    ]
    fps = config.site.fps

    def score(way: str, rows: Rows, began: float, stages: Mapping[str, float] | None = None) -> WayScore:
        ms = 1e3 * (time.process_time() - began) / length
        recordings = {camera: TruthAndTracks(scene.gt[camera], rows[camera]) for camera in scene.gt}
        by_stage = {stage: 1e3 * seconds / length for stage, seconds in (stages or {}).items()}
        return WayScore(way, evaluate_cameras(recordings, MIN_IOU), ms, by_stage)

    if JOINT in ways:
        began = time.process_time()
        with timed_stages() as clock:
            tracker = GroundPlaneTracker(cameras, GroundSettings(), create_solver(solver), fps)
            joint = rows_of(track_ground_plane(tracker, enumerate(frames)), cameras)
        yield score(JOINT, joint, began, clock.seconds)
    if BY_FRAME in ways:
        began = time.process_time()
        yield score(BY_FRAME, track_frame_by_frame(_in_meters(cameras, frames), frames, fps), began)
    if SERVED in ways:
        began = time.process_time()
        served = scene.config(track={"joint": True})
        yield score(SERVED, decide(served, track_scene(served, detections.frames)).tracks, began)
    if {JOINED, NEAREST, ALONE} & set(ways):
        began = time.process_time()
        messages = track_scene(config, detections.frames)
        tracked = own_tracks(messages)
        taken = time.process_time() - began
        if JOINED in ways:
            began = time.process_time() - taken
            yield score(JOINED, decide(config, messages).tracks, began)
        if NEAREST in ways:
            began = time.process_time() - taken
            yield score(NEAREST, by_nearest_feet(tracked, homographies), began)
        if ALONE in ways:
            yield score(ALONE, unassociated_tracks(tracked), time.process_time() - taken)


def rows_of(frames: list[GroundFrame], cameras: Mapping[str, GroundCamera]) -> dict[str, list[MotRow]]:
    """Return each camera's boxes as rows."""
    rows: dict[str, list[MotRow]] = {camera: [] for camera in cameras}
    for frame in frames:
        for track in frame.tracks:
            for camera, found in track.boxes.items():
                rows[camera].append(MotRow.of_box(frame.frame + 1, track.id, found.box.tolist()))
    return rows


def _in_meters(
    cameras: Mapping[str, GroundCamera], frames: list[dict[str, Detections]]
) -> dict[str, GroundCamera]:
    """Return the cameras with homographies to meters, by the heights of the first people."""
    for detections in frames:
        boxes = {index: detections[name].boxes for index, name in enumerate(cameras) if name in detections}
        units = estimate_units_per_meter(list(cameras.values()), boxes)
        if units is not None:
            return {name: camera.scaled(units) for name, camera in cameras.items()}
    return dict(cameras)
