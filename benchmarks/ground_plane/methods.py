"""The compared methods: tracked jointly, per camera and joined afterwards, and frame by frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
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
class MethodScore:
    """The scores of one method on one scene."""

    method: str
    scores: MultiCameraScores
    ms: float
    """Processor time per frame of all cameras, without detection."""
    stages: Mapping[str, float]
    """The same by stage, where it is known."""


def run_methods(
    scene: BenchmarkScene, detections: SceneDetections, methods: list[str], solver: str
) -> Iterator[MethodScore]:
    """Run the selected methods on a scene."""
    cameras = {
        camera: GroundCamera(homography, *detections.frames[camera].size)
        for camera, homography in scene.homographies.items()
    }
    frames = _by_frame(detections)
    fps = scene.config().site.fps

    def score(
        method: str, rows: Rows, began: float, stages: Mapping[str, float] | None = None
    ) -> MethodScore:
        ms = 1e3 * (time.process_time() - began) / len(frames)
        recordings = {camera: TruthAndTracks(scene.gt[camera], rows[camera]) for camera in scene.gt}
        by_stage = {stage: 1e3 * seconds / len(frames) for stage, seconds in (stages or {}).items()}
        return MethodScore(method, evaluate_cameras(recordings, MIN_IOU), ms, by_stage)

    if JOINT in methods:
        began = time.process_time()
        with timed_stages() as clock:
            tracker = GroundPlaneTracker(cameras, GroundSettings(), create_solver(solver), fps)
            joint = rows_of(track_ground_plane(tracker, enumerate(frames)), cameras)
        yield score(JOINT, joint, began, clock.seconds)
    if BY_FRAME in methods:
        began = time.process_time()
        yield score(BY_FRAME, track_frame_by_frame(_in_meters(cameras, frames), frames, fps), began)
    if SERVED in methods:
        began = time.process_time()
        served = scene.config(track={"joint": True})
        yield score(SERVED, decide(served, track_scene(served, detections.frames)).tracks, began)
    for method, rows, seconds in _per_camera(scene, detections, methods):
        yield score(method, rows, time.process_time() - seconds)


def _per_camera(
    scene: BenchmarkScene, detections: SceneDetections, methods: list[str]
) -> Iterator[tuple[str, Rows, float]]:
    """Track in each camera once, and associate by the selected methods; yield each with its seconds."""
    if not {JOINED, NEAREST, ALONE} & set(methods):
        return
    began = time.process_time()
    config = scene.config(track={"joint": False})
    messages = track_scene(config, detections.frames)
    tracked = own_tracks(messages)
    tracking_s = time.process_time() - began
    associations: dict[str, Callable[[], Rows]] = {
        JOINED: lambda: decide(config, messages).tracks,
        NEAREST: lambda: by_nearest_feet(tracked, scene.homographies),
        ALONE: lambda: unassociated_tracks(tracked),
    }
    for method, associate in associations.items():
        if method in methods:
            began = time.process_time()
            rows = associate()
            yield method, rows, tracking_s + time.process_time() - began


def _by_frame(detections: SceneDetections) -> list[dict[str, Detections]]:
    """Return the detections of each frame by camera; cameras that have ended are left out."""
    length = max(len(found.detections) for found in detections.frames.values())
    return [
        {
            camera: found.detections[index]
            for camera, found in detections.frames.items()
            if index < len(found.detections)
        }
        for index in range(length)
    ]


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
