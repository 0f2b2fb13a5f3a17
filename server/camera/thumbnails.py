"""Thumbnails of the tracked people, cut from the newest frame."""

from __future__ import annotations

import cv2
import numpy as np

from server.camera.sources import Image
from server.messaging.messages import Box, CameraTracks

_HEIGHT = 160
"""Pixels; sharp enough for a thumbnail on a dense screen."""
_MARGIN = 0.15
"""Of the box's size, around the person."""
_QUALITY = 82


def thumbnails(image: Image, tracks: CameraTracks) -> dict[int, bytes]:
    """Return a JPEG by track of each person visible in the window's last frame, ``image``."""
    pictures = {}
    for track in tracks.tracks:
        box = track.boxes[-1] if track.boxes else None
        part = None if box is None else _cut_out(image, box)
        if part is None:
            continue
        scale = _HEIGHT / part.shape[0]
        size = (max(1, round(part.shape[1] * scale)), _HEIGHT)
        done, jpeg = cv2.imencode(
            ".jpg", cv2.resize(part, size, interpolation=cv2.INTER_AREA), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        )
        if done:
            pictures[track.id] = np.asarray(jpeg).tobytes()
    return pictures


def _cut_out(image: Image, box: Box) -> Image | None:
    left, top, right, bottom = box
    x, y = _MARGIN * (right - left), _MARGIN * (bottom - top)
    part = image[
        max(0, int(top - y)) : max(0, int(bottom + y)), max(0, int(left - x)) : max(0, int(right + x))
    ]
    return part if part.size else None
