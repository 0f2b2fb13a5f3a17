"""What other cameras say about a camera's boxes: who hides somebody in one view stands apart in another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview.geometry.ground_plane import (
    feet_cut_off,
    foot_covariance,
    foot_points,
    from_ground,
    person_heights,
    to_ground,
)

Floats = NDArray[np.float64]

_PERSON_ASPECT_RATIO = 0.38
"""Width of a standing person over their height."""
_ACROSS = np.array([-0.25, 0.0, 0.25])
_UP = (np.arange(6) + 0.5) / 6
"""Points of a standing person that are asked about: shares of the width and of the height."""

_OVERLAP_GRID = 24
"""Points along each side of a picture by which common ground is found."""
_OVERLAP_MARGIN = 0.25
"""Share of the picture's size by which people may stand outside of it."""


@dataclass(frozen=True, slots=True)
class CrossViewSettings:
    """How much each camera goes by what the others see at the same pulse."""

    enabled: bool = True  # false: every camera tracks by what it sees itself
    confirmation_boost: float = (
        0.6  # share of the doubt in a box that another camera's very same one takes away
    )
    absence_penalty: float = (
        0.2  # share of a box's score that is lost where another camera plainly sees nobody
    )
    gate_heights: float = 0.3  # how far apart two cameras may see the same feet, in person heights
    foot_sideways: float = 0.05  # how well boxes find the feet: standard deviation in box heights, across
    foot_upwards: float = 0.15  # and up and down
    minimum_occluder_score: float = 0.3  # least score of a box that may hide who is behind it
    clear_view_share: float = (
        0.5  # share of a body that must be in plain view for its absence to say anything
    )

    def __post_init__(self) -> None:
        for name in ("confirmation_boost", "absence_penalty", "minimum_occluder_score", "clear_view_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name}: is {getattr(self, name)} but must be from 0 to 1")
        for name in ("gate_heights", "foot_sideways", "foot_upwards"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ValueError(f"{name}: is {getattr(self, name)} but must be above 0")


@dataclass(frozen=True, slots=True, eq=False)
class CameraGeometry:
    """Where a camera looks from.

    Attributes:
        homography: (3, 3) from its own picture, pixels, to the ground.
        size: width and height of that picture.
        ignored_regions: polygons (C, 2) in it where nobody is looked for.
    """

    homography: Floats
    size: tuple[float, float]
    ignored_regions: Sequence[Floats] = field(default=())


@dataclass(frozen=True, slots=True, eq=False)
class CameraDetections:
    """What a camera found in one frame.

    Attributes:
        boxes: (K, 4) left, top, right, bottom in pixels of its own picture.
        scores: (K,) in [0, 1].
    """

    boxes: Floats
    scores: Floats


def rescore_detections(
    own: CameraGeometry,
    found: CameraDetections,
    others: Sequence[tuple[CameraGeometry, CameraDetections]],
    settings: CrossViewSettings,
) -> Floats:
    """Give a camera's scores (K,) again, knowing what other cameras found at the same pulse.

    With `a` how surely another camera has somebody standing there, and `d` how surely one has nobody
    there, both of the camera that says so most: `s + raised a (1 - s) - lowered d s`. Cameras that are
    not given say nothing, and nothing is said about who stands nowhere on the ground.
    """
    there, nobody = np.zeros(found.scores.shape), np.zeros(found.scores.shape)
    for vantage, seen in others:
        near = _confirmation(own, found, vantage, seen, settings)
        there = np.maximum(there, near)
        nobody = np.maximum(nobody, (1.0 - near) * _clear_absence(own, found, vantage, seen, settings))
    score = found.scores
    return np.clip(
        score
        + settings.confirmation_boost * there * (1.0 - score)
        - settings.absence_penalty * nobody * score,
        0.0,
        1.0,
    )


def views_overlap(own: CameraGeometry, other: CameraGeometry) -> bool:
    """Tell whether the other camera sees ground that a camera sees, or nearly so.

    Asked about are points all over the camera's picture and as far below it as boxes reach.
    """
    width, height = own.size
    x, y = np.meshgrid(
        np.linspace(0.0, width, _OVERLAP_GRID),
        np.linspace(0.0, height * (1.0 + _OVERLAP_MARGIN), _OVERLAP_GRID),
    )
    there = from_ground(other.homography, to_ground(own.homography, np.stack([x, y], axis=-1)))
    far = np.array(other.size) * _OVERLAP_MARGIN
    return bool(((there >= -far) & (there <= far + other.size)).all(axis=-1).any())


def _confirmation(
    own: CameraGeometry,
    found: CameraDetections,
    other: CameraGeometry,
    seen: CameraDetections,
    settings: CrossViewSettings,
) -> Floats:
    """How surely the other camera has somebody standing at each place: (K,)."""
    if not len(seen.scores):
        return np.zeros(found.scores.shape)
    one, spread_one = _foot_positions(own, found.boxes, settings)
    two, spread_two = _foot_positions(other, seen.boxes, settings)
    gate = settings.gate_heights * person_heights(own.homography, found.boxes)
    x, y = np.moveaxis(one[:, None] - two[None], -1, 0)
    spread = spread_one[:, None] + spread_two[None]
    xx, yy = spread[..., 0, 0] + gate[:, None] ** 2, spread[..., 1, 1] + gate[:, None] ** 2
    xy = spread[..., 0, 1]
    # Squared length of (x, y) in the metric of the inverse covariance, the 2x2 inverse written out.
    area = xx * yy - xy * xy
    length = yy * x * x - 2.0 * xy * x * y + xx * y * y
    squared = np.divide(length, area, out=np.full(area.shape, np.inf), where=(area > 0) & ~np.isnan(length))
    sure = np.exp(-0.5 * squared) * seen.scores
    return np.asarray(sure.max(axis=1))


def _foot_positions(
    vantage: CameraGeometry, boxes: Floats, settings: CrossViewSettings
) -> tuple[Floats, Floats]:
    """Give each box's feet on the ground, (K, 2), NaN where they are cut off, and their covariance."""
    cut = feet_cut_off(boxes, vantage.size[1])
    ground = to_ground(vantage.homography, foot_points(boxes))
    spread = foot_covariance(vantage.homography, boxes, settings.foot_sideways, settings.foot_upwards)
    return np.where(cut[:, None], np.nan, ground), spread


def _clear_absence(
    own: CameraGeometry,
    found: CameraDetections,
    other: CameraGeometry,
    seen: CameraDetections,
    settings: CrossViewSettings,
) -> Floats:
    """How plainly the other camera would see each person stand there, if they did: (K,), 0 to 1.

    Asked about are points all over the body: in the picture, not where nobody is looked for, and in no
    box of somebody who may hide them. Above the share `clear_view_share` of them it counts ever more.
    """
    points = _body_points(own, found.boxes, other, settings)
    width, height = other.size
    x, y = points[..., 0], points[..., 1]
    shown = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
    for left, top, right, bottom in seen.boxes[seen.scores >= settings.minimum_occluder_score]:
        shown &= ~((x >= left) & (x <= right) & (y >= top) & (y <= bottom))
    for polygon in other.ignored_regions:
        shown &= ~_inside_polygon(points, polygon)
    share = shown.mean(axis=1)
    return np.asarray(
        np.clip((share - settings.clear_view_share) / max(1.0 - settings.clear_view_share, 1e-9), 0.0, 1.0)
    )


def _body_points(
    own: CameraGeometry, boxes: Floats, other: CameraGeometry, settings: CrossViewSettings
) -> Floats:
    """Give points all over where the other camera would see each person: (K, P, 2), NaN where nowhere."""
    ground, _ = _foot_positions(own, boxes, settings)
    foot = from_ground(other.homography, ground)
    # How long a pixel is there tells how tall somebody of this height is.
    pixel = np.concatenate([foot - (0.0, 1.0), foot], axis=-1)
    tall = person_heights(own.homography, boxes) / person_heights(other.homography, pixel)
    x = foot[:, None, None, 0] + tall[:, None, None] * _PERSON_ASPECT_RATIO * _ACROSS
    y = foot[:, None, None, 1] - tall[:, None, None] * _UP[:, None]
    return np.stack(np.broadcast_arrays(x, y), axis=-1).reshape(len(boxes), _ACROSS.size * _UP.size, 2)


def _inside_polygon(points: Floats, polygon: Floats) -> NDArray[np.bool_]:
    """Tell which points (..., 2) lie in a polygon (C, 2): a line to the right crosses it oddly often."""
    x, y = points[..., 0], points[..., 1]
    inside = np.zeros(x.shape, dtype=np.bool_)
    for (x1, y1), (x2, y2) in zip(polygon, np.roll(polygon, 1, axis=0), strict=True):
        if y1 != y2:
            inside ^= ((y1 > y) != (y2 > y)) & (x < (x2 - x1) * (y - y1) / (y2 - y1) + x1)
    return inside
