"""Thumbnails of the tracked people, cut from the newest frame."""

from __future__ import annotations

import cv2
import numpy as np

from server.camera.sources import Image
from server.camera.substream.picture_scale import PictureScale
from server.messaging.messages import Box, CameraTracks
from server.messaging.packed_arrays import last_box

_HEIGHT = 160
"""Height in pixels: sharp enough on a high-resolution screen."""
_MARGIN = 0.15
"""Margin around the box, as a share of its size."""
_QUALITY = 82


def encode_thumbnails(
    image: Image, tracks: CameraTracks, scale: PictureScale | None = None
) -> dict[int, bytes]:
    """Return by track the JPEG thumbnail of each person visible in the window's last frame, ``image``.

    ``scale``: of the image; None: the site's.
    """
    thumbnails = {}
    for track in tracks.tracks:
        box = last_box(track.boxes)
        if box is not None and scale is not None:
            box = scale.box_from_site(box)
        crop = None if box is None else _crop(image, box)
        if crop is None:
            continue
        factor = _HEIGHT / crop.shape[0]
        size = (max(1, round(crop.shape[1] * factor)), _HEIGHT)
        is_encoded, jpeg = cv2.imencode(
            ".jpg", cv2.resize(crop, size, interpolation=cv2.INTER_AREA), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        )
        if is_encoded:
            thumbnails[track.id] = np.asarray(jpeg).tobytes()
    return thumbnails


def _crop(image: Image, box: Box) -> Image | None:
    left, top, right, bottom = box
    x, y = _MARGIN * (right - left), _MARGIN * (bottom - top)
    crop = image[
        max(0, int(top - y)) : max(0, int(bottom + y)), max(0, int(left - x)) : max(0, int(right + x))
    ]
    return crop if crop.size else None
