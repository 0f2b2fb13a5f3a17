"""Where people are in the frames of a decided GOP."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from bestview import estimate_bodies, foot_points
from bestview.geometry.ground_plane import upright_from_overhead
from server.media.letterbox import Letterbox
from server.rules import PeopleOfFrame
from server.rules.zones import Point
from server.service.view_selection.decider import GopDecision

Floats = NDArray[np.float64]


def people_of_frames(
    decision: GopDecision,
    usable: Collection[str],
    letterboxes: Mapping[str, Letterbox],
    overhead: Collection[str],
) -> Iterator[PeopleOfFrame]:
    """Yield where people are in each frame of a GOP, by the boxes of cameras whose pictures are usable.

    A position on the floor is the mean over the calibrated cameras that see the feet, weighted by precision.
    """
    cameras = [camera for camera, frames in decision.boxes.items() if camera in usable and any(frames)]
    boxes = {camera: _boxes(decision.boxes[camera], camera in overhead) for camera in cameras}
    floor = _floor_positions(decision, {camera: boxes[camera] for camera in cameras}, letterboxes)
    for index in range(decision.frames):
        pictures: dict[str, dict[int, Point]] = {}
        seen_by: dict[int, set[str]] = {}
        for camera in cameras:
            frame, numbers, placed = boxes[camera]
            rows = np.flatnonzero(frame == index)
            feet = letterboxes[camera].site_to_camera(foot_points(placed[rows]))
            pictures[camera] = {
                number: (x, y) for number, (x, y) in zip(numbers[rows].tolist(), feet.tolist(), strict=True)
            }
            for number in pictures[camera]:
                seen_by.setdefault(number, set()).add(camera)
        people = {number: frozenset(seen) for number, seen in sorted(seen_by.items())}
        yield PeopleOfFrame(decision.first + index, floor.get(index, {}), pictures, people)


def _boxes(
    frames: list[list[tuple[int, float, float, float, float]]], is_overhead: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Return frame, number and box of each row, boxes as if upright: (B,), (B,), (B, 4)."""
    rows = [(index, *box) for index, frame in enumerate(frames) for box in frame]
    table = np.array(rows, dtype=np.float64).reshape(-1, 6)
    boxes = table[:, 2:]
    upright = upright_from_overhead(boxes) if is_overhead else boxes
    return table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), upright


def _floor_positions(
    decision: GopDecision,
    boxes: Mapping[str, tuple[NDArray[np.int64], NDArray[np.int64], Floats]],
    letterboxes: Mapping[str, Letterbox],
) -> dict[int, dict[int, Point]]:
    """Return positions on the floor by frame (from 0) and number."""
    grounds = {camera: decision.pictures[camera].ground for camera in boxes}
    calibrated = [camera for camera, ground in grounds.items() if ground is not None]
    if not calibrated:
        return {}
    keys = np.concatenate([np.column_stack(boxes[camera][:2]) for camera in calibrated])
    owners, moment = np.unique(keys, axis=0, return_inverse=True)
    bodies = estimate_bodies(
        np.concatenate([boxes[camera][2] for camera in calibrated]),
        np.repeat(np.arange(len(calibrated)), [len(boxes[camera][0]) for camera in calibrated]),
        moment.reshape(-1),
        len(owners),
        np.array([grounds[camera] for camera in calibrated]),
        np.array([_bottom(letterboxes[camera]) for camera in calibrated]),
    )
    positions: dict[int, dict[int, Point]] = {}
    for (frame, number), (x, y) in zip(owners.tolist(), bodies.ground_point.tolist(), strict=True):
        if np.isfinite(x):
            positions.setdefault(frame, {})[number] = (x, y)
    return positions


def _bottom(letterbox: Letterbox) -> float:
    """Return the lower edge of a camera's image in the site's, pixels."""
    return float(letterbox.camera_to_site(np.array([0.0, letterbox.camera_size[1]]))[1])
