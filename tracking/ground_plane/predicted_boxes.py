"""The boxes of people in cameras that do not detect them, from their places and sizes."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.ground_plane.camera import BoxSizes, GroundCamera, feet
from tracking.ground_plane.places.measurements import Measurements
from tracking.ground_plane.places.visibility import in_picture

_BOXES_KEPT = 60


class PersonBoxes:
    """Width and height of a person, relative to everybody's at the same place of a picture."""

    def __init__(self) -> None:
        self._ratios: deque[tuple[float, float]] = deque(maxlen=_BOXES_KEPT)
        self._median: Floats | None = None

    def update(self, box: Floats, usual: Floats) -> None:
        """Add a detected box (4,), where everybody's is `usual` (4,); NaN: not known."""
        width, height = usual[2] - usual[0], usual[3] - usual[1]
        if np.isfinite(height):
            self._ratios.append(((box[2] - box[0]) / width, (box[3] - box[1]) / height))
            self._median = None

    @property
    def ratios(self) -> Floats:
        """Width and height to the usual ones, (2,); NaN: not known."""
        if self._median is None:
            self._median = np.median(self._ratios, axis=0) if self._ratios else np.full(2, np.nan)
        return self._median


def usual_boxes(measurements: Measurements, sizes: Sequence[BoxSizes]) -> Floats:
    """Return the boxes of usual people whose feet are those of each detection, (D, 4); NaN: not known."""
    usual = np.full((len(measurements), BOX_SIDES), np.nan)
    for camera, size in enumerate(sizes):
        seen = measurements.camera == camera
        if size.known and seen.any():
            usual[seen] = size.boxes(feet(measurements.boxes[seen]))
    return usual


def predict_boxes(
    people: Sequence[PersonBoxes], places: Floats, cameras: Sequence[GroundCamera], sizes: Sequence[BoxSizes]
) -> Floats:
    """Return the boxes of people at places (N, 2) in each camera, (N, C, 4).

    NaN: outside of the picture, or not known.
    """
    boxes = np.full((len(people), len(cameras), BOX_SIDES), np.nan)
    if not len(people):
        return boxes
    width, height = np.array([person.ratios for person in people]).T
    for index, (camera, size) in enumerate(zip(cameras, sizes, strict=True)):
        if not size.known:
            continue
        left, top, right, bottom = size.boxes(camera.to_image(places)).T
        half, middle = width * (right - left) / 2.0, (left + right) / 2.0
        found = np.stack([middle - half, bottom - height * (bottom - top), middle + half, bottom], axis=1)
        seen = in_picture(found, camera)
        boxes[seen, index] = found[seen]
    return boxes
