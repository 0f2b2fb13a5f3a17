"""The box of a person in a camera that does not detect them, from their place and size."""

from __future__ import annotations

from collections import deque

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.camera import BoxSizes, GroundCamera, feet
from tracking.ground_plane.places.visibility import in_picture

_BOXES_KEPT = 60


class PersonBoxes:
    """Height and width of a person, relative to everybody's at the same place of a picture."""

    def __init__(self) -> None:
        self._ratios: deque[tuple[float, float]] = deque(maxlen=_BOXES_KEPT)

    def update(self, box: Floats, sizes: BoxSizes) -> None:
        """Add a detected box (4,)."""
        if not sizes.known:
            return
        usual = sizes.boxes(feet(box[None]))[0]
        width, height = usual[2] - usual[0], usual[3] - usual[1]
        if np.isfinite(height):
            self._ratios.append(((box[2] - box[0]) / width, (box[3] - box[1]) / height))

    def predict(self, place: Floats, camera: GroundCamera, sizes: BoxSizes) -> Floats | None:
        """Return the box (4,) of the person at a place (2,); None: outside the picture, or unknown."""
        if not sizes.known or not self._ratios:
            return None
        left, top, right, bottom = sizes.boxes(camera.to_image(place[None]))[0]
        width, height = np.median(self._ratios, axis=0)
        half = width * (right - left) / 2.0
        middle = (left + right) / 2.0
        box = np.array([middle - half, bottom - height * (bottom - top), middle + half, bottom])
        return box if in_picture(box[None], camera)[0] else None
