"""Facing term of view quality: walking towards the camera or away from it."""

from __future__ import annotations

import numpy as np

from bestview.geometry.ground_plane import foot_points, person_heights, to_ground
from bestview.quality.framing import Floats

_HALF_CONFIDENCE_SPEED = 0.15
"""Heights a second (about 0.25 m/s): at this speed the walking direction counts half."""

_PIXEL_DOWN = np.array([0.0, 1.0])

NEUTRAL = 0.5
"""Score of people who stand, cross the view, or have no ground point."""


def facing_score(boxes: Floats, homography: Floats, fps: float) -> Floats:
    """Return 1 for walking towards the camera, 0 for walking away, 1/2 for standing or crossing.

    With *v* the velocity of the feet on the ground over the frames given (least squares) and *u* the ground
    direction that points down the picture at the feet, which is towards the camera::

        1/2 + 1/2 cos(v, u) |v| / (|v| + 0.15 heights a second)

    Args:
        boxes: (K, N, 4) pixels of one camera over a window of N frames, about half a second; NaN: hidden.
        homography: (3, 3) from those pixels to the ground.
        fps: frames per second.

    Returns:
        (K,) values in [0, 1], one for the whole window.
    """
    ground = to_ground(homography, foot_points(boxes))
    known = ~np.isnan(ground[..., 0])
    frame_count = known.sum(axis=1)
    enough = frame_count > 1
    weight = known / np.maximum(frame_count, 1)[:, None]
    time = np.arange(boxes.shape[1]) / fps
    centered_time = time - (weight * time).sum(axis=1, keepdims=True)
    spread = (weight * centered_time**2).sum(axis=1)
    # Hidden frames have weight 0, but NaN times 0 would be NaN.
    ground_point = np.where(known[..., None], ground, 0.0)
    velocity = ((weight * centered_time)[..., None] * ground_point).sum(axis=1) / np.where(
        enough, spread, 1.0
    )[:, None]

    middle = (weight[..., None] * np.where(known[..., None], boxes, 0.0)).sum(axis=1)
    foot = foot_points(middle)
    down = to_ground(homography, foot + _PIXEL_DOWN) - to_ground(homography, foot)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    length = np.hypot(down[:, 0], down[:, 1])
    along = (velocity * down).sum(axis=1)
    # cos(v, u) |v| / (|v| + ...): the speed cancels against the cosine's divisor.
    divisor = length * (speed + _HALF_CONFIDENCE_SPEED * person_heights(homography, middle))
    valid = enough & (divisor > 0)
    towards = np.divide(along, divisor, out=np.zeros(len(boxes)), where=valid)
    return np.asarray(NEUTRAL + NEUTRAL * towards)
