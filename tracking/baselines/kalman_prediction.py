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
_INITIAL_VARIANCE = np.diag([10.0, 10.0, 10.0, 10.0, 1e4, 1e4, 1e4])
"""The velocity of a new target is unknown."""
_PROCESS_NOISE = np.diag([1.0, 1.0, 1.0, 1.0, 0.01, 0.01, 1e-4])
_MEASUREMENT_NOISE = np.diag([1.0, 1.0, 10.0, 10.0])


class KalmanPrediction:
    """Constant-velocity prediction, corrected by the detections."""

    name = "kalman"
    uses_image = False

    def initialize(self, image: Image, box: Floats) -> cv2.KalmanFilter:  # noqa: ARG002 — the image is not used
        """Create a filter for a box with zero velocity."""
        kalman = cv2.KalmanFilter(_STATES, _MEASURED, 0, cv2.CV_64F)
        transition = np.eye(_STATES)
        transition[[0, 1, 2], [4, 5, 6]] = 1.0
        kalman.transitionMatrix, kalman.measurementMatrix = transition, np.eye(_MEASURED, _STATES)
        kalman.processNoiseCov, kalman.measurementNoiseCov = _PROCESS_NOISE.copy(), _MEASUREMENT_NOISE.copy()
        kalman.errorCovPost = _INITIAL_VARIANCE.copy()
        kalman.statePost = np.concatenate([_measurement(box), np.zeros(_STATES - _MEASURED)])[:, None]
        return kalman

    def predict(self, image: Image | None, targets: Sequence[cv2.KalmanFilter]) -> Floats:  # noqa: ARG002
        """Return the predicted boxes, `(N, 4)`."""
        if not targets:
            return np.empty((0, BOX_SIDES))
        return np.stack([_box(np.asarray(target.predict(), dtype=np.float64)[:, 0]) for target in targets])

    def update(self, target: cv2.KalmanFilter, box: Floats) -> Floats:
        """Correct the state by a detection; return the corrected box."""
        return _box(np.asarray(target.correct(_measurement(box)[:, None]), dtype=np.float64)[:, 0])


def _measurement(box: Floats) -> Floats:
    left, top, right, bottom = box
    width, height = max(right - left, 1e-6), max(bottom - top, 1e-6)
    return np.array([(left + right) / 2, (top + bottom) / 2, width * height, width / height])


def _box(state: Floats) -> Floats:
    x, y, area, aspect = state[:_MEASURED]
    width = float(np.sqrt(max(area * aspect, 0.0)))
    height = max(area, 0.0) / width if width > 0.0 else 0.0
    return np.array([x - width / 2, y - height / 2, x + width / 2, y + height / 2])
