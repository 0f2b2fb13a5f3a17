"""How probably each camera detects a person at a place: a miss is evidence only where they should be seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, heights, shares_within
from tracking.ground_plane.camera import BoxSizes, GroundCamera
from tracking.ground_plane.places.measurements import Measurements

_FREE_SHARE, _HIDDEN_SHARE = 0.3, 0.9
"""Shares of a box that others hide, up to which nothing and from which nearly everything is lost."""
_HIDDEN_FACTOR = 0.15
_UNCOVERED, _COVERED = 0.2, 0.7
"""Shares of a box behind a cover up to which the person is detected as elsewhere, and from which never."""
_PIXEL = 1.0
_NEARER = 0.02
"""Box heights by which a foot must be lower to be of somebody nearer to the camera."""
_MAX_CUT = 0.7
"""Share of a box's height that may be outside of the picture."""


def detection_probabilities(
    places: Floats,
    cameras: Sequence[GroundCamera],
    sizes: Sequence[BoxSizes],
    measurements: Measurements,
    own: NDArray[np.bool_],
    probability: float,
) -> Floats:
    """Return the probability that each camera detects a person at each place (N, 2), (N, C).

    Detections hide places behind them, except the place's own: (N, D). `probability` is that of a person whom
    nobody hides. A camera that has not searched the frame detects nobody.
    """
    found = np.zeros((len(places), len(cameras)))
    for index, (camera, size) in enumerate(zip(cameras, sizes, strict=True)):
        if not measurements.looked[index]:
            continue
        points = camera.to_image(places)
        if not size.known:
            at_feet = np.concatenate([points - _PIXEL / 2.0, points + _PIXEL / 2.0], axis=1)
            shown = camera.contains(points) * (1.0 - camera.covered_shares(at_feet))
            found[:, index] = probability * shown
            continue
        boxes = size.boxes(points)
        of_camera = measurements.camera == index
        hidden = _hidden_shares(boxes, measurements.boxes[of_camera], own[:, of_camera])
        lost = np.clip((hidden - _FREE_SHARE) / (_HIDDEN_SHARE - _FREE_SHARE), 0.0, 1.0 - _HIDDEN_FACTOR)
        covered = (camera.covered_shares(boxes) - _UNCOVERED) / (_COVERED - _UNCOVERED)
        left = (1.0 - lost) * (1.0 - np.clip(covered, 0.0, 1.0))
        found[:, index] = np.where(in_picture(boxes, camera), probability * left, 0.0)
    return found


def in_picture(boxes: Floats, camera: GroundCamera) -> NDArray[np.bool_]:
    """Return which boxes (N, 4) are in the picture to a large part; NaN is not."""
    middles = (boxes[:, 0] + boxes[:, 2]) / 2.0
    heads, feet = (camera.shown(np.stack([middles, boxes[:, row]], axis=1)) for row in (1, 3))
    tall = feet[:, 1] - heads[:, 1]
    inside = np.minimum(feet[:, 1], camera.height) - np.maximum(heads[:, 1], 0.0)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (feet[:, 0] >= 0) & (feet[:, 0] < camera.width) & (inside > (1.0 - _MAX_CUT) * tall)
        )


def _hidden_shares(boxes: Floats, others: Floats, own: NDArray[np.bool_]) -> Floats:
    """Return the largest share of each box (N, 4) that one of the others (K, 4), nearer, hides, (N,)."""
    if not len(others):
        return np.zeros(len(boxes))
    with np.errstate(invalid="ignore"):
        shares = shares_within(boxes, others)
        nearer = others[None, :, 3] > (boxes[:, 3] + _NEARER * heights(boxes))[:, None]
    return np.asarray(np.nan_to_num(np.where(nearer & ~own, shares, 0.0)).max(axis=1))
