"""Sharpness of each person's image, measured once per window, in its last frame."""

from __future__ import annotations

import cv2
import msgspec
import numpy as np

from server.camera.sources import Image
from server.camera.substream.picture_scale import PictureScale
from server.messaging.messages import Box, CameraTracks
from server.messaging.packed_arrays import last_box

_WIDTH, _HEIGHT = 32, 64
"""People are scaled to this size first, so that detail is measured per person, not per pixel."""

_NOISE = 25.0
"""Gray levels squared: contrast below this is the camera's noise."""

_HALF = 0.25
"""The share of detail in the contrast that counts as half sharp: people blurred by about a fiftieth of their
height are below it, people in focus above it."""

_MIN_SIDE = 4
"""Pixels of a side below which sharpness is not measured."""


class SharpnessMemory:
    """Keeps the last sharpness of each track, for windows in whose last frame the person is hidden."""

    def __init__(self) -> None:
        self._values: dict[int, float] = {}

    def measure(
        self, message: CameraTracks, last_image: Image | None, scale: PictureScale | None = None
    ) -> CameraTracks:
        """Return the message with its tracks' sharpness in the window's last image, if there is one.

        In an image of a smaller ``scale`` than the site's, people who are too small are not measured: they
        would look blurred, and viewers see them sharp.
        """
        for track in message.tracks:
            box = last_box(track.boxes)
            value = None
            if last_image is not None and box is not None:
                value = _sharpness_at(scale, last_image, box)
            if value is not None:
                self._values[track.id] = value
        self._values = {
            track.id: self._values[track.id] for track in message.tracks if track.id in self._values
        }
        tracks = [
            msgspec.structs.replace(track, sharpness=self._values.get(track.id)) for track in message.tracks
        ]
        return msgspec.structs.replace(message, tracks=tracks)


def _sharpness_at(scale: PictureScale | None, image: Image, box: Box) -> float | None:
    if scale is None or scale.is_identity:
        return sharpness(image, box)
    tracked = scale.box_from_site(box)
    return sharpness(image, tracked) if tracked[3] - tracked[1] >= _HEIGHT else None


def sharpness(image: Image, box: Box) -> float | None:
    """Return the sharpness inside a box, 0 to 1: ``d / (d + 1/4)``; None where the box is too small.

    *d* is the variance of the Laplacian over that of the gray levels, at 32 by 64 pixels: blur removes detail
    and leaves contrast.
    """
    height, width = image.shape[:2]
    left, top, right, bottom = (round(side) for side in box)
    crop = image[max(top, 0) : min(bottom, height), max(left, 0) : min(right, width)]
    if min(crop.shape[:2]) < _MIN_SIDE:
        return None
    shrinking = crop.shape[0] > _HEIGHT
    small = cv2.resize(
        cv2.cvtColor(crop, cv2.COLOR_BGR2GRAY),
        (_WIDTH, _HEIGHT),
        interpolation=cv2.INTER_AREA if shrinking else cv2.INTER_LINEAR,
    ).astype(np.float64)
    detail = float(cv2.Laplacian(small, cv2.CV_64F).var()) / (float(small.var()) + _NOISE)
    return detail / (detail + _HALF)
