"""A network's boxes, carried along by the image's motion until the network runs again."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, heights, widths
from tracking.detectors.base import Image, Mask
from tracking.types import Detections

_WINDOW, _LEVELS = (13, 13), 2
"""Window, in pixels of the working image, and pyramid levels of the optical flow (Bouguet 2000)."""
_ACROSS, _DOWN = np.linspace(0.3, 0.7, 4), np.linspace(0.12, 0.6, 5)
"""Where points of a person lie inside of a box: on head and trunk, since legs swing."""
_MAX_MOVE = 0.3
"""Largest movement of a point between two images, in heights; beyond, its flow is wrong."""
_MIN_POINTS = 6


class CarriedBoxes:
    """The last boxes of a network, moved with the median flow of the points in each."""

    def __init__(self) -> None:
        self.found = Detections.empty(0)
        """The boxes, in pixels of the working image, with the scores that the network gave them."""
        self._gray: Mask | None = None

    def renew(self, work_image: Image, found: Detections) -> None:
        """Replace the boxes by new ones `(N, 4)`, in pixels of the working image."""
        self._gray, self.found = _gray(work_image), found

    def carry(self, work_image: Image) -> None:
        """Move the boxes to where their content is in the next image."""
        before, self._gray = self._gray, _gray(work_image)
        boxes = self.found.boxes
        if before is None or not len(boxes):
            return
        points = _points_of(boxes)
        flow, status, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]
            before, self._gray, points.reshape(-1, 1, 2), None, winSize=_WINDOW, maxLevel=_LEVELS
        )
        shifts = (flow.reshape(points.shape) - points).astype(np.float64)
        is_usable = status.reshape(points.shape[:2]) == 1
        is_usable &= np.abs(shifts).max(axis=2) <= _MAX_MOVE * heights(boxes)[:, None]
        moved = boxes.copy()
        for row, (shift, usable) in enumerate(zip(shifts, is_usable, strict=True)):
            if np.count_nonzero(usable) >= _MIN_POINTS:
                moved[row] += np.tile(np.median(shift[usable], axis=0), 2)
        self.found = Detections(moved, self.found.scores, self.found.histograms)


def _gray(image: Image) -> Mask:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _points_of(boxes: Floats) -> npt.NDArray[np.float32]:
    """Return the points in each box `(N, P, 2)`."""
    down, across = (grid.ravel() for grid in np.meshgrid(_DOWN, _ACROSS, indexing="ij"))
    x = boxes[:, [0]] + across * widths(boxes)[:, None]
    y = boxes[:, [1]] + down * heights(boxes)[:, None]
    return np.stack([x, y], axis=2).astype(np.float32)
