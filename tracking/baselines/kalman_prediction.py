"""Prediction by a Kalman filter on boxes (SORT: Bewley et al., ICIP 2016).

The state is the box's center, area and aspect ratio, and the velocities of all but the aspect ratio; a
detection measures the first four. The image is not used.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_STATES, _MEASURED = 7, 4
_FIRST = np.diag([10.0, 10.0, 10.0, 10.0, 1e4, 1e4, 1e4])
"""Variance of what is known of somebody new: nothing is known of their velocity."""
_MOVES = np.diag([1.0, 1.0, 1.0, 1.0, 0.01, 0.01, 1e-4])
_ERRS = np.diag([1.0, 1.0, 10.0, 10.0])


class KalmanPrediction:
    """Constant velocity, corrected by the detections."""

    name = "kalman"
    uses_image = False

    def initialize(self, image: Image, box: Floats) -> cv2.KalmanFilter:  # noqa: ARG002 — the box is all
        """Create a filter for a box with zero velocity."""
        known = cv2.KalmanFilter(_STATES, _MEASURED, 0, cv2.CV_64F)
        flow = np.eye(_STATES)
        flow[[0, 1, 2], [4, 5, 6]] = 1.0
        known.transitionMatrix, known.measurementMatrix = flow, np.eye(_MEASURED, _STATES)
        known.processNoiseCov, known.measurementNoiseCov = _MOVES.copy(), _ERRS.copy()
        known.errorCovPost = _FIRST.copy()
        known.statePost = np.concatenate([_measured(box), np.zeros(_STATES - _MEASURED)])[:, None]
        return known

    def predict(self, image: Image | None, objects: Sequence[cv2.KalmanFilter]) -> Floats:  # noqa: ARG002
        """Return the predicted boxes, `(N, 4)`."""
        if not objects:
            return np.empty((0, BOX_SIDES))
        return np.stack([_box(np.asarray(it.predict(), dtype=np.float64)[:, 0]) for it in objects])

    def update(self, known: cv2.KalmanFilter, box: Floats) -> Floats:
        """Correct the state by a detection; return the corrected box."""
        return _box(np.asarray(known.correct(_measured(box)[:, None]), dtype=np.float64)[:, 0])


def _measured(box: Floats) -> Floats:
    left, top, right, bottom = box
    wide, tall = max(right - left, 1e-6), max(bottom - top, 1e-6)
    return np.array([(left + right) / 2, (top + bottom) / 2, wide * tall, wide / tall])


def _box(state: Floats) -> Floats:
    x, y, area, aspect = state[:_MEASURED]
    wide = float(np.sqrt(max(area * aspect, 0.0)))
    tall = max(area, 0.0) / wide if wide > 0.0 else 0.0
    return np.array([x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2])
