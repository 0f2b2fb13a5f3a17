"""The detections of all cameras in one frame as measurements of places on the ground plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, heights, shares_within
from tracking.ground_plane.camera import GroundCamera, feet
from tracking.ground_plane.gaussians import determinants
from tracking.ground_plane.settings import GroundSettings
from tracking.types import Detections

PERSON_M = 1.7
"""Height of a person in meters, from which the unit of a ground plane follows."""
_MIN_LOG_ODDS, _MAX_LOG_ODDS = -4.0, 3.0
"""Scores are not certain: log odds for which they count at least and at most. Detectors that suppress boxes
beside a better one give them a score of 0, though many are of people."""
_NOT_COVERED, _COVERED = 0.3, 0.95
"""Shares of a box within a better one up to which its score holds, and from which it loses all it can.

In between it loses linearly more, as scores of true and false detections in pictures do.
"""
MISPLACED_FOOT_NOISE = 0.15
"""Standard deviation of feet that are wrong: hidden, in a shadow or cut off; box heights."""


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """The D detections of a frame.

    Attributes:
        looked: (C,) bool, the cameras that have searched this frame: only these can miss anybody.
        camera: (D,) index of the camera.
        index: (D,) of the detection among those of its camera.
        boxes: (D, 4) pixels.
        histograms: appearance of each, (B,); B = 0: unknown.
        places: (D, 2) of the feet, meters.
        covariances: (D, 2, 2) of the places, m²: the noise of a foot carried through the homography, so that
            distant feet are long ellipses, and that of the calibration.
        log_odds: (D,) of the scores.
        log_clutter: (D,) log of the expected false detections per m² there, less the log odds of the score,
            which counts for less within better boxes of the camera: those are parts of a person more often.
        misplacements: (D, 2, 2) covariances of the places' errors if the feet are wrong, m²: along the line
            of sight.
    """

    looked: NDArray[np.bool_]
    camera: NDArray[np.int64]
    index: NDArray[np.int64]
    boxes: Floats
    histograms: tuple[Floats, ...]
    places: Floats
    covariances: Floats
    log_odds: Floats
    log_clutter: Floats
    misplacements: Floats

    def __len__(self) -> int:
        return len(self.camera)


def measure(
    cameras: Sequence[GroundCamera],
    detections: Sequence[Detections | None],
    noise: Floats,
    settings: GroundSettings,
) -> Measurements:
    """Locate the detections of each camera on the plane; None: it has not searched the frame.

    `noise`: (C,) factors of the assumed standard deviations of the places.
    """
    looked = np.array([found is not None for found in detections])
    all_found = [Detections.empty(0) if found is None else found for found in detections]
    parts = [
        _measure_camera(camera, found, float(factor), settings)
        for camera, found, factor in zip(cameras, all_found, noise, strict=True)
    ]
    return Measurements(
        looked,
        np.repeat(np.arange(len(cameras)), [len(found) for found in all_found]),
        np.concatenate([np.arange(len(found)) for found in all_found]),
        np.concatenate([found.boxes for found in all_found]),
        tuple(histogram for found in all_found for histogram in found.histograms),
        np.concatenate([part.places for part in parts]),
        np.concatenate([part.covariances for part in parts]),
        np.concatenate([part.log_odds for part in parts]),
        np.concatenate([part.log_clutter for part in parts]),
        np.concatenate([part.misplacements for part in parts]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Located:
    """Fields of `Measurements` of one camera, by where its detections are and by their scores."""

    places: Floats
    covariances: Floats
    log_odds: Floats
    log_clutter: Floats
    misplacements: Floats


def _measure_camera(
    camera: GroundCamera, found: Detections, factor: float, settings: GroundSettings
) -> _Located:
    points, tall = feet(found.boxes), np.maximum(heights(found.boxes), 1.0)
    places, jacobians = camera.to_ground(points), camera.jacobians(points)
    deviations = settings.foot_noise * tall
    covariances = deviations[:, None, None] ** 2 * jacobians @ np.swapaxes(jacobians, 1, 2)
    covariances = factor**2 * (covariances + settings.calibration_noise**2 * np.eye(2))
    per_pixel = settings.false_per_frame / (camera.width * camera.height)
    scores = np.clip(found.scores, 1e-6, 1.0 - 1e-6)
    odds = np.clip(np.log(scores / (1.0 - scores)), _MIN_LOG_ODDS, _MAX_LOG_ODDS)
    counted = odds - settings.covered_log_odds * covered_by_better(found.boxes, odds)
    log_clutter = np.log(per_pixel) - np.log(np.abs(determinants(jacobians))) - counted
    # Feet that are hidden are lower: above them the horizon may be near.
    hidden = np.stack([points[:, 0], points[:, 1] + MISPLACED_FOOT_NOISE * tall], axis=1)
    nearer = camera.to_ground(hidden) - places
    return _Located(places, covariances, odds, log_clutter, nearer[:, :, None] * nearer[:, None, :])


def covered_by_better(boxes: Floats, log_odds: Floats) -> Floats:
    """Return how much of each box (K, 4) of a picture a better one covers, from 0 to 1, (K,).

    Of two boxes, each is the better one with a probability that their log odds (K,) determine.
    """
    if not len(boxes):
        return np.zeros(0)
    shares = shares_within(boxes, boxes)
    np.fill_diagonal(shares, 0.0)
    covers = np.clip((shares - _NOT_COVERED) / (_COVERED - _NOT_COVERED), 0.0, 1.0)
    better = 1.0 / (1.0 + np.exp(log_odds[:, None] - log_odds[None]))
    return np.asarray((covers * better).max(axis=1))


def estimate_units_per_meter(cameras: Sequence[GroundCamera], boxes: Mapping[int, Floats]) -> float | None:
    """Return how many units of the plane a meter has, by the heights of people's boxes; None without boxes.

    `boxes` (K, 4) by the index of the camera. Where somebody stands, a pixel to the side is as long as one
    upward.
    """
    lengths = [
        np.linalg.norm(cameras[index].jacobians(feet(found))[:, :, 0], axis=1) * heights(found)
        for index, found in boxes.items()
        if len(found)
    ]
    return float(np.median(np.concatenate(lengths)) / PERSON_M) if lengths else None
