"""Detections whose feet are wrong, though they are of the person at a place.

Feet behind a table, in a shadow or below the picture locate somebody else, or nobody. Head and sides still
show whose box it is: such a detection supports a place that others locate, and does not move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, heights
from tracking.ground_plane.camera import BoxSizes, GroundCamera, feet
from tracking.ground_plane.gaussians import LOG_2PI, determinants
from tracking.ground_plane.places.measurements import MISPLACED_FOOT_NOISE, Measurements
from tracking.ground_plane.settings import GroundSettings

_TOP_NOISE, _SIDE_NOISE = 0.07, 0.05
"""Standard deviations of such a box's other edges from the usual one's at the place, box heights. The first
is that of how tall people are."""


@dataclass(frozen=True, slots=True, eq=False)
class MisplacedDetections:
    """What they add to the K hypotheses of places.

    Attributes:
        members: (K, D) bool, at most one detection of each camera that does not see the place otherwise.
        costs: (K,) that they add to a place, below 0 where there are any.
    """

    members: NDArray[np.bool_]
    costs: Floats


def find_misplaced(
    measurements: Measurements,
    members: NDArray[np.bool_],
    places: Floats,
    misses: Floats,
    cameras: Sequence[GroundCamera],
    sizes: Sequence[BoxSizes],
    settings: GroundSettings,
) -> MisplacedDetections:
    """Find the detections that make a place likelier with their feet in the wrong place than without them.

    Args:
        measurements: the D detections of the frame.
        members: (K, D) the detections that each place has.
        places: (K, 2) meters.
        misses: (K, C) costs of each camera not detecting the person at each place.
        cameras: the C cameras, over a plane in meters.
        sizes: of people's boxes in each.
        settings: how often feet are misplaced.
    """
    added, costs = np.zeros_like(members), np.zeros(len(members))
    for c, (camera, size) in enumerate(zip(cameras, sizes, strict=True)):
        seen = np.flatnonzero(measurements.camera == c)
        missing = np.flatnonzero(~members[:, seen].any(axis=1) & (misses[:, c] > 0.0))
        if not (size.known and len(seen) and len(missing)):
            continue
        usual = size.boxes(camera.to_image(places[missing]))
        gains = misses[missing, c, None] - _costs(measurements, seen, usual, camera, settings)
        best = gains.argmax(axis=1)
        gain = gains[np.arange(len(missing)), best]
        chosen = gain > 0.0
        added[missing[chosen], seen[best[chosen]]] = True
        costs[missing[chosen]] -= gain[chosen]
    return MisplacedDetections(added, costs)


def _costs(
    measurements: Measurements,
    seen: NDArray[np.int64],
    usual: Floats,
    camera: GroundCamera,
    settings: GroundSettings,
) -> Floats:
    """Return the costs (K, D) of detections being of people with the usual boxes (K, 4), and not false."""
    tall = heights(usual)[:, None]
    # A camera that was turned shows what was outside of its picture.
    cut = usual if camera.turned is not None else np.clip(usual, 0.0, [camera.width, camera.height] * 2)
    shown = cut[:, None]
    boxes = measurements.boxes[seen][None]
    deviations = np.stack(
        [
            (boxes[..., 1] - shown[..., 1]) / tall / _TOP_NOISE,
            (boxes[..., 3] - shown[..., 3]) / tall / MISPLACED_FOOT_NOISE,
            (boxes[..., [0, 2]] - shown[..., [0, 2]]).mean(axis=2) / tall / _SIDE_NOISE,
        ]
    )
    # The density is per m², like that of false detections.
    square_meters = np.abs(determinants(camera.jacobians(feet(boxes[0]))))
    costs = (
        0.5 * (deviations**2).sum(axis=0)
        + LOG_2PI
        + np.log(MISPLACED_FOOT_NOISE * _SIDE_NOISE * tall**2 * square_meters)
        + measurements.log_clutter[seen]
        - np.log(settings.misplaced_probability * settings.detection_probability)
    )
    return np.asarray(np.where(np.isfinite(costs), costs, np.inf))
