"""People who walk about on a floor, and cameras over it, made up from a seed, to try calibration on."""

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
    """Standard deviations in box heights, as smooth in time as a tracker's errors are."""

    sideways: float = 0.02
    upwards: float = 0.03


def camera_at(
    east: float, north: float, towards: tuple[float, float] = (0.0, 0.0), focal: float = 0.8
) -> Pinhole:
    """A camera 1.7 person heights above the floor that looks at a place there."""
    parameters = np.zeros(8)
    away = np.array(towards) - (east, north)
    parameters[FOCAL] = np.log(focal)
    parameters[ASPECT] = parameters[ROLL] = 0.0
    parameters[CAMERA_HEIGHT] = np.log(1.7)
    parameters[TILT] = np.arctan2(1.1, np.hypot(*away))
    parameters[PAN] = np.arctan2(away[1], away[0])
    parameters[[EAST, NORTH]] = east, north
    return Pinhole(parameters, SIZE)


def stroll(random: np.random.Generator, frames: int, wide: float = 2.0) -> Floats:
    """Places of somebody who walks to one place after another, (frames, 2) person heights."""
    places = [random.uniform(-wide, wide, 2)]
    goal = random.uniform(-wide, wide, 2)
    heading = np.zeros(2)
    for _ in range(frames - 1):
        if np.hypot(*(goal - places[-1])) < 0.3:
            goal = random.uniform(-wide, wide, 2)
        way = goal - places[-1]
        heading = 0.9 * heading + 0.1 * way / np.hypot(*way)
        places.append(places[-1] + STEP * heading)
    return np.array(places)


def seen(
    name: str,
    camera: Pinhole,
    paths: Sequence[Floats],
    random: np.random.Generator,
    offset: int = 0,
    noise: Noise | None = None,
) -> Walk:
    """What a camera sees of people whose frame 0 is pulse `offset`, without who is out of its picture."""
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
    """How far off the found homographies put known places, the whole floor turned and shifted at will.

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
    turned = x * np.exp(1j * np.angle((np.conj(x) * y).sum()))
    return np.abs(turned - y).reshape(len(found), -1)


def _smooth(random: np.random.Generator, count: int, spread: float) -> Floats:
    """Noise that changes over half a second."""
    rough = random.normal(0, 1, count + 12)
    return np.asarray(np.convolve(rough, np.ones(13) / np.sqrt(13), "valid") * spread)
