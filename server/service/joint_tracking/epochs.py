"""The joint tracker's part of an epoch: what it gets of the cameras, and what becomes of their messages."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import msgspec

from server.config.ground_unit import UNITS_PER_METER
from server.config.site_config import Config
from server.messaging.messages import CameraTracks, TrackMessage
from server.messaging.packed_arrays import first_boxes
from server.service.ingest.epoch_aligner import Epoch, JointEpoch
from server.service.joint_tracking.joint_messages import (
    CameraObservations,
    JointSetup,
    JointTask,
    JointTracks,
    Row,
)


def joint_setup(config: Config) -> JointSetup:
    """Return what joint tracking needs to know of a site that has `joint_cameras`."""
    track, fps = config.track, config.site.fps
    cameras = [config.camera(camera) for camera in config.joint_cameras]
    units = {UNITS_PER_METER.get(camera.ground_unit or "") for camera in cameras}
    stride_s, budget = config.window.stride / fps, track.solver_budget(fps)
    return JointSetup(
        homographies={camera.id: _rows(camera.ground or []) for camera in cameras},
        site_size=config.site.size,
        fps=fps,
        stride_s=stride_s,
        lag_s=max(track.final_lag(fps), 1) / fps,
        units_per_meter=units.pop() if len(units) == 1 else None,
        solver=track.solver,
        # The process does nothing else, so that it may work all the time.
        solver_work_s=None if budget.work_s is None else stride_s,
        solver_time_s=budget.time_s,
    )


def joint_task(epoch: Epoch, cameras: Sequence[str]) -> JointTask:
    """Return the observations of an epoch in the cameras that are tracked jointly."""
    return JointTask(
        last=epoch.last,
        cameras={
            camera: CameraObservations(
                size=message.size,
                frames=message.observations,
                motion=message.motion,
                covered=message.covered,
                last=message.last,
                ended=message.ended,
            )
            for camera, message in epoch.tracks.items()
            if camera in cameras
        },
    )


def merge_tasks(tasks: Sequence[JointTask]) -> JointTask:
    """Return the observations of successive epochs as those of one."""
    cameras: dict[str, CameraObservations] = {}
    for task in tasks:
        for camera, part in task.cameras.items():
            before = cameras[camera].frames if camera in cameras else []
            cameras[camera] = msgspec.structs.replace(part, frames=[*before, *part.frames])
    return JointTask(last=tasks[-1].last, cameras=cameras)


def merge_joint_tracks(message: CameraTracks, joint: JointTracks) -> CameraTracks:
    """Return a camera's message with the people who are tracked jointly instead of its own tracks.

    The last message of a recording that ends before the others is final as far as it goes.
    """
    last = min(joint.last, message.last) if message.ended else joint.last
    frames = max(0, last - joint.first + 1)
    return msgspec.structs.replace(
        message,
        first=joint.first,
        last=last,
        final_to=last if message.ended else joint.final_to,
        tracks=[_first_frames(track, frames, last) for track in joint.cameras[message.camera]],
        solve=joint.solve,
        risk_events=[],
        revised_from=None,
        observations=[],
    )


def with_joint_tracks(epoch: Epoch, joint: JointTracks) -> Epoch:
    """Return an epoch with joint tracks in the messages of their cameras."""
    own = {camera: message for camera, message in epoch.tracks.items() if camera in joint.cameras}
    merged = {camera: merge_joint_tracks(message, joint) for camera, message in own.items()}
    return replace(epoch, tracks=epoch.tracks | merged, joint=JointEpoch(joint, own))


def without_tracks(epoch: Epoch, cameras: Collection[str]) -> Epoch:
    """Return an epoch in which these cameras, which are tracked jointly, show nobody."""
    empty = {
        camera: msgspec.structs.replace(message, tracks=[], observations=[])
        for camera, message in epoch.tracks.items()
        if camera in cameras
    }
    return replace(epoch, tracks=epoch.tracks | empty, trackless=frozenset(empty))


def _first_frames(track: TrackMessage, frames: int, last: int) -> TrackMessage:
    boxes = first_boxes(track.boxes, frames)
    if boxes == track.boxes:
        return track
    appearance = [sample for sample in track.appearance if sample.last <= last]
    return msgspec.structs.replace(track, boxes=boxes, appearance=appearance)


def _rows(homography: Sequence[Sequence[float]]) -> tuple[Row, Row, Row]:
    first, second, third = ((row[0], row[1], row[2]) for row in homography)
    return first, second, third
