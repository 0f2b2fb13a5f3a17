"""Simulated people walking on a floor, and cameras above it, for calibration tests; all from a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestview import to_ground
from bestview.calibration import Floats, Walk, WalkTrack
from bestview.calibration.pinhole import ASPECT, CAMERA_HEIGHT, EAST, FOCAL, NORTH, PAN, ROLL, TILT, Pinhole

SIZE = (640, 360)
STEP = 0.032  # person heights a frame: 1.4 m/s at 25 frames a second


@dataclass(frozen=True)
class Noise:
    """Standard deviations in box heights; the noise is smooth in time, like a tracker's errors."""

    sideways: float = 0.02
    upwards: float = 0.03


def camera_at(
    east: float, north: float, towards: tuple[float, float] = (0.0, 0.0), focal: float = 0.8
) -> Pinhole:
    """Return a camera 1.7 person heights above the floor that looks at a point on it."""
    parameters = np.zeros(8)
    direction = np.array(towards) - (east, north)
    parameters[FOCAL] = np.log(focal)
    parameters[ASPECT] = parameters[ROLL] = 0.0
    parameters[CAMERA_HEIGHT] = np.log(1.7)
    parameters[TILT] = np.arctan2(1.1, np.hypot(*direction))
    parameters[PAN] = np.arctan2(direction[1], direction[0])
    parameters[[EAST, NORTH]] = east, north
    return Pinhole(parameters, SIZE)


def random_path(random: np.random.Generator, frames: int, wide: float = 2.0) -> Floats:
    """Return the path of a person who walks from point to point, `(frames, 2)` person heights."""
    places = [random.uniform(-wide, wide, 2)]
    goal = random.uniform(-wide, wide, 2)
    heading = np.zeros(2)
    for _ in range(frames - 1):
        if np.hypot(*(goal - places[-1])) < 0.3:
            goal = random.uniform(-wide, wide, 2)
        step = goal - places[-1]
        heading = 0.9 * heading + 0.1 * step / np.hypot(*step)
        places.append(places[-1] + STEP * heading)
    return np.array(places)


def recorded_walk(
    name: str,
    camera: Pinhole,
    paths: Sequence[Floats],
    random: np.random.Generator,
    offset: int = 0,
    noise: Noise | None = None,
) -> Walk:
    """Return a camera's tracks of people in its picture; its frame 0 is pulse `offset`."""
    noise = noise or Noise()
    tracks = []
    for path in paths:
        feet = camera.picture(path)
        tall = camera.heights(feet)
        feet = feet + tall[:, None] * np.column_stack(
            [_smooth(random, len(path), noise.sideways), _smooth(random, len(path), noise.upwards)]
        )
        tall = tall * (1 + _smooth(random, len(path), 0.02))
        boxes = np.column_stack([feet[:, 0] - tall / 5, feet[:, 1] - tall, feet[:, 0] + tall / 5, feet[:, 1]])
        whole = (
            (boxes[:, 0] > 2) & (boxes[:, 1] > 2) & (boxes[:, 2] < SIZE[0] - 2) & (boxes[:, 3] < SIZE[1] - 2)
        )
        parts = np.split(np.arange(len(path)), np.flatnonzero(np.diff(whole.astype(int))) + 1)
        tracks += [
            WalkTrack(int(part[0]) - offset, boxes[part])
            for part in parts
            if whole[part[0]] and len(part) > 10
        ]
    return Walk(name, SIZE, tuple(tracks))


def error_on_floor(found: Sequence[Floats], truth: Sequence[Pinhole], place: Floats, person: float) -> Floats:
    """Compute the errors of known points by the found homographies, after the best rotation and shift.

    Returns:
        Distances in person heights, (cameras, N).
    """
    where = np.stack(
        [
            to_ground(matrix, camera.picture(place)) / person
            for matrix, camera in zip(found, truth, strict=True)
        ]
    )
    x = where.reshape(-1, 2) @ np.array([1, 1j])
    y = np.tile(place @ np.array([1, 1j]), len(found))
    x, y = x - x.mean(), y - y.mean()
    rotated = x * np.exp(1j * np.angle((np.conj(x) * y).sum()))
    return np.abs(rotated - y).reshape(len(found), -1)


def _smooth(random: np.random.Generator, count: int, spread: float) -> Floats:
    """Return noise that is smooth over half a second."""
    rough = random.normal(0, 1, count + 12)
    return np.asarray(np.convolve(rough, np.ones(13) / np.sqrt(13), "valid") * spread)
