"""Pixelates people in a picture so that nobody is recognized."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from av.video.frame import VideoFrame
from numpy.typing import NDArray

from server.media.rendering_messages import WHOLE_PICTURE, Region

_CELLS = 6
"""Cells along the longer side of a region: a standing person's head is about one of them."""
_CELL_MIN = 8
"""Pixels of a cell's side at least: the faces of small people have hardly more."""
_REGIONS_MAX = 256
"""Above so many regions the whole picture is pixelated."""


def pixelate(image: NDArray[np.uint8], regions: Sequence[Region]) -> NDArray[np.uint8]:
    """Return a picture ``(height, width, 3)`` with every region replaced by cells of one color, their mean.

    Regions are widened to whole pixels. Where several overlap, one of them is seen.
    """
    height, width = image.shape[:2]
    pixelated = image.copy()
    for region in regions:
        left, top = (max(0, math.floor(edge)) for edge in region[:2])
        right, bottom = min(width, math.ceil(region[2])), min(height, math.ceil(region[3]))
        if left >= right or top >= bottom:
            continue
        part = image[top:bottom, left:right]
        side = max(_CELL_MIN, math.ceil(max(part.shape[:2]) / _CELLS))
        columns, rows = max(1, (right - left) // side), max(1, (bottom - top) // side)
        cells = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
        size = (right - left, bottom - top)
        pixelated[top:bottom, left:right] = cv2.resize(cells, size, interpolation=cv2.INTER_NEAREST)
    return pixelated


class RegionMemory:
    """The regions of the picture that was shown last.

    A stream without a gap repeats its last picture where one is missing: people are then where they were.
    """

    def __init__(self) -> None:
        self._last: VideoFrame | None = None
        self._regions: list[Region] = []

    def regions_in(self, frame: VideoFrame, regions: Sequence[Region]) -> list[Region]:
        """Return the regions of a frame, and those of the frames before that it repeats exactly."""
        shown = [*regions]
        if self._last is not None and _is_repetition(self._last, frame):
            known = set(shown)
            shown += [region for region in self._regions if region not in known]
        self._last, self._regions = frame, shown if len(shown) <= _REGIONS_MAX else [WHOLE_PICTURE]
        return self._regions


def _is_repetition(before: VideoFrame, frame: VideoFrame) -> bool:
    if (before.width, before.height) != (frame.width, frame.height):
        return False
    return bool(np.array_equal(_luma(before), _luma(frame)))


def _luma(frame: VideoFrame) -> NDArray[np.uint8]:
    plane = frame.planes[0]
    rows = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)
    return rows[: frame.height, : frame.width]
