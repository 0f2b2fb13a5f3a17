"""Cross-view scoring: detection scores corrected by the detections of other cameras at the same place."""

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
"""Points of a standing person at which visibility is tested: shares of the width ..."""
_UP = (np.arange(6) + 0.5) / 6
"""... and of the height."""

_OVERLAP_GRID = 24
"""Points along each side of a picture at which common ground is tested."""
_OVERLAP_MARGIN = 0.25
"""Share of the picture's size by which people may stand outside of it."""


@dataclass(frozen=True, slots=True)
class CrossViewSettings:
    """How much the detections of other cameras at the same pulse change a camera's detection scores."""

    enabled: bool = True  # false: every camera keeps its own scores
    confirmation_boost: float = 0.6  # share of 1 - score that is added for a certain confirmation
    absence_penalty: float = 0.2  # share of the score that is lost if another camera clearly sees no person
    gate_heights: float = 0.3  # distance at which feet in two cameras may be of one person, person heights
    foot_sideways: float = 0.05  # standard deviations of foot points in box heights: across
    foot_upwards: float = 0.15  # and along the line of sight
    minimum_occluder_score: float = 0.3  # least score of a box that counts as an occluder
    clear_view_share: float = 0.5  # visible share of a body above which its absence counts

    def __post_init__(self) -> None:
        for name in ("confirmation_boost", "absence_penalty", "minimum_occluder_score", "clear_view_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name}: is {getattr(self, name)} but must be from 0 to 1")
        for name in ("gate_heights", "foot_sideways", "foot_upwards"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ValueError(f"{name}: is {getattr(self, name)} but must be above 0")


@dataclass(frozen=True, slots=True, eq=False)
class CameraGeometry:
    """Homography and picture of a camera.

    Attributes:
        homography: (3, 3) from its own picture, pixels, to the ground.
        size: width and height of that picture.
        ignored_regions: polygons (C, 2) in it where detection is off.
        covered: (K, 4) rectangles in it in which people are hidden: the lens is covered, leaves move.
    """

    homography: Floats
    size: tuple[float, float]
    ignored_regions: Sequence[Floats] = field(default=())
    covered: Floats = field(default_factory=lambda: np.empty((0, 4)))


@dataclass(frozen=True, slots=True, eq=False)
class CameraDetections:
    """A camera's detections in one frame.

    Attributes:
        boxes: (K, 4) left, top, right, bottom in pixels of its own picture.
        scores: (K,) in [0, 1].
    """

    boxes: Floats
    scores: Floats


def rescore_detections(
    own: CameraGeometry,
    detections: CameraDetections,
    others: Sequence[tuple[CameraGeometry, CameraDetections]],
    settings: CrossViewSettings,
) -> Floats:
    """Return a camera's detection scores (K,), corrected by the detections of other cameras.

    ``s + confirmation_boost a (1 - s) - absence_penalty d s``, where `a` is the confirmation by a camera that
    detects a person at the same ground point and `d` the evidence of a camera with a clear view of an empty
    place, each the maximum over the cameras. Boxes without ground point keep their score.
    """
    confirmation, absence = np.zeros(detections.scores.shape), np.zeros(detections.scores.shape)
    for camera, other_detections in others:
        near = _confirmation(own, detections, camera, other_detections, settings)
        confirmation = np.maximum(confirmation, near)
        absence = np.maximum(
            absence, (1.0 - near) * _clear_absence(own, detections, camera, other_detections, settings)
        )
    score = detections.scores
    return np.clip(
        score
        + settings.confirmation_boost * confirmation * (1.0 - score)
        - settings.absence_penalty * absence * score,
        0.0,
        1.0,
    )


def views_overlap(own: CameraGeometry, other: CameraGeometry) -> bool:
    """Return whether two cameras see any common ground, within a margin, so that one can confirm the other.

    A single place is enough, while `FloorView.overlaps`, for joint tracking, needs a share of the floor.
    Tested on a grid over the camera's picture and a margin below it, as far as boxes may reach.
    """
    width, height = own.size
    x, y = np.meshgrid(
        np.linspace(0.0, width, _OVERLAP_GRID),
        np.linspace(0.0, height * (1.0 + _OVERLAP_MARGIN), _OVERLAP_GRID),
    )
    projected = from_ground(other.homography, to_ground(own.homography, np.stack([x, y], axis=-1)))
    margin = np.array(other.size) * _OVERLAP_MARGIN
    return bool(((projected >= -margin) & (projected <= margin + other.size)).all(axis=-1).any())


def _confirmation(
    own: CameraGeometry,
    detections: CameraDetections,
    other: CameraGeometry,
    other_detections: CameraDetections,
    settings: CrossViewSettings,
) -> Floats:
    """Compute how certainly the other camera detects a person at each box's ground point: (K,), 0 to 1."""
    if not len(other_detections.scores):
        return np.zeros(detections.scores.shape)
    own_points, own_covariance = _foot_positions(own, detections.boxes, settings)
    other_points, other_covariance = _foot_positions(other, other_detections.boxes, settings)
    gate = settings.gate_heights * person_heights(own.homography, detections.boxes)
    x, y = np.moveaxis(own_points[:, None] - other_points[None], -1, 0)
    spread = own_covariance[:, None] + other_covariance[None]
    xx, yy = spread[..., 0, 0] + gate[:, None] ** 2, spread[..., 1, 1] + gate[:, None] ** 2
    xy = spread[..., 0, 1]
    # Squared length of (x, y) in the metric of the inverse covariance, the 2x2 inverse written out.
    area = xx * yy - xy * xy
    length = yy * x * x - 2.0 * xy * x * y + xx * y * y
    squared = np.divide(length, area, out=np.full(area.shape, np.inf), where=(area > 0) & ~np.isnan(length))
    likelihood = np.exp(-0.5 * squared) * other_detections.scores
    return np.asarray(likelihood.max(axis=1))


def _foot_positions(
    camera: CameraGeometry, boxes: Floats, settings: CrossViewSettings
) -> tuple[Floats, Floats]:
    """Return each box's ground point, (K, 2), NaN where the feet are cut off, and its covariance."""
    cut_off = feet_cut_off(boxes, camera.size[1])
    points = to_ground(camera.homography, foot_points(boxes))
    spread = foot_covariance(camera.homography, boxes, settings.foot_sideways, settings.foot_upwards)
    return np.where(cut_off[:, None], np.nan, points), spread


def _clear_absence(
    own: CameraGeometry,
    detections: CameraDetections,
    other: CameraGeometry,
    other_detections: CameraDetections,
    settings: CrossViewSettings,
) -> Floats:
    """Compute how clear the other camera's view of each person is: (K,), 0 to 1.

    Tested at points all over the body: inside the picture, outside ignored and covered regions and not behind
    a detected box. Above the share `clear_view_share` of visible points it rises linearly to 1.
    """
    points = _body_points(own, detections.boxes, other, settings)
    width, height = other.size
    x, y = points[..., 0], points[..., 1]
    visible = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
    occluders = other_detections.boxes[other_detections.scores >= settings.minimum_occluder_score]
    for left, top, right, bottom in np.concatenate([occluders, other.covered]):
        visible &= ~((x >= left) & (x <= right) & (y >= top) & (y <= bottom))
    for polygon in other.ignored_regions:
        visible &= ~_inside_polygon(points, polygon)
    share = visible.mean(axis=1)
    return np.asarray(
        np.clip((share - settings.clear_view_share) / max(1.0 - settings.clear_view_share, 1e-9), 0.0, 1.0)
    )


def _body_points(
    own: CameraGeometry, boxes: Floats, other: CameraGeometry, settings: CrossViewSettings
) -> Floats:
    """Return points all over each person, projected into the other camera: (K, P, 2), NaN: behind it."""
    ground, _ = _foot_positions(own, boxes, settings)
    foot = from_ground(other.homography, ground)
    # The size of a pixel on the ground gives the height of the person in the other picture.
    one_pixel = np.concatenate([foot - (0.0, 1.0), foot], axis=-1)
    height = person_heights(own.homography, boxes) / person_heights(other.homography, one_pixel)
    x = foot[:, None, None, 0] + height[:, None, None] * _PERSON_ASPECT_RATIO * _ACROSS
    y = foot[:, None, None, 1] - height[:, None, None] * _UP[:, None]
    return np.stack(np.broadcast_arrays(x, y), axis=-1).reshape(len(boxes), _ACROSS.size * _UP.size, 2)


def _inside_polygon(points: Floats, polygon: Floats) -> NDArray[np.bool_]:
    """Return which points (..., 2) lie in a polygon (C, 2), by the even-odd rule."""
    x, y = points[..., 0], points[..., 1]
    inside = np.zeros(x.shape, dtype=np.bool_)
    for (x1, y1), (x2, y2) in zip(polygon, np.roll(polygon, 1, axis=0), strict=True):
        if y1 != y2:
            inside ^= ((y1 > y) != (y2 > y)) & (x < (x2 - x1) * (y - y1) / (y2 - y1) + x1)
    return inside
