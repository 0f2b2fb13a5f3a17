"""How sharp the picture of each person is: measured once a window, on its last frame."""

from __future__ import annotations

import cv2
import msgspec
import numpy as np

from server.camera.sources import Image
from server.messaging.messages import Box, CameraTracks

_WIDTH, _HEIGHT = 32, 64
"""Everybody is brought to this size first, so that what counts is detail of the person, not of the pixels."""

_NOISE = 25.0
"""Grey levels squared: contrast below this is the camera's noise."""

_HALF = 0.25
"""The share of detail in the contrast that counts as half sharp: people blurred by about a fiftieth of their
height are below it, people in focus above it."""

_LEAST = 4
"""Pixels of a side below which nothing can be said."""


class SharpnessMemory:
    """Remembers the last sharpness of each track, for windows in whose last frame it is hidden."""

    def __init__(self) -> None:
        self._known: dict[int, float] = {}

    def measured(self, message: CameraTracks, image: Image | None) -> CameraTracks:
        """Return message with the sharpness of its tracks; ``image`` is the window's last frame, if any."""
        for track in message.tracks:
            box = track.boxes[-1] if track.boxes else None
            value = None if image is None or box is None else sharpness(image, box)
            if value is not None:
                self._known[track.id] = value
        self._known = {it.id: self._known[it.id] for it in message.tracks if it.id in self._known}
        tracks = [
            msgspec.structs.replace(track, sharpness=self._known.get(track.id)) for track in message.tracks
        ]
        return msgspec.structs.replace(message, tracks=tracks)


def sharpness(image: Image, box: Box) -> float | None:
    """Return how much detail there is inside a box, 0 to 1: ``d / (d + 1/4)``; None where it is too small.

    *d* is the variance of the Laplacian of the person, 32 by 64 pixels and grey, over that of the grey
    itself: a blur takes detail and leaves contrast.
    """
    height, width = image.shape[:2]
    left, top, right, bottom = (round(side) for side in box)
    part = image[max(top, 0) : min(bottom, height), max(left, 0) : min(right, width)]
    if min(part.shape[:2]) < _LEAST:
        return None
    shrinking = part.shape[0] > _HEIGHT
    small = cv2.resize(
        cv2.cvtColor(part, cv2.COLOR_BGR2GRAY),
        (_WIDTH, _HEIGHT),
        interpolation=cv2.INTER_AREA if shrinking else cv2.INTER_LINEAR,
    ).astype(np.float64)
    detail = float(cv2.Laplacian(small, cv2.CV_64F).var()) / (float(small.var()) + _NOISE)
    return detail / (detail + _HALF)
