"""Orientation and pixel aspect: how a stored picture is rotated, mirrored and stretched for display."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

import cv2
import numpy as np
from av.sidedata.sidedata import SideData
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.sources.base import Image
from server.media.color_conversion import to_bgr

_MATRIX_NAME = "DISPLAYMATRIX"
_MATRIX = struct.Struct("=9i")
_MAX_ASPECT = 4.0
"""A pixel aspect beyond this counts as damage."""
INTERLACED = "it is interlaced: each frame mixes two moments; deinterlace it for better detection"
"""The warning about interlaced video, which is used as it is."""
_SQUARE = 0.01
"""Deviation from square pixels that is ignored: encoders round."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """The transformation of a stored picture for display.

    Attributes:
        transposed: rows become columns, before mirroring.
        mirrored_x: left and right are exchanged.
        mirrored_y: top and bottom are exchanged.
        pixel_aspect: width of a stored pixel over its height.
    """

    transposed: bool = False
    mirrored_x: bool = False
    mirrored_y: bool = False
    pixel_aspect: float = 1.0

    @property
    def description(self) -> str:
        """The transformation as text; empty: none."""
        if self.is_rotated:
            return "rotated or mirrored (display matrix)"
        if self.pixel_aspect != 1.0:
            return f"stretched (its pixels are {self.pixel_aspect:.3g} times as wide as high)"
        return ""

    @property
    def is_rotated(self) -> bool:
        """Whether the picture is shown rotated or mirrored."""
        return self.transposed or self.mirrored_x or self.mirrored_y

    def size(self, stored: tuple[int, int]) -> tuple[int, int]:
        """Return the displayed width and height of a picture of a stored size."""
        width, height = max(1, round(stored[0] * self.pixel_aspect)), stored[1]
        return (height, width) if self.transposed else (width, height)

    def image(self, picture: VideoFrame) -> Image:
        """Return the picture as displayed, ``(height, width, 3)`` BGR."""
        image = to_bgr(picture)
        if self.pixel_aspect != 1.0:
            upright = replace(self, transposed=False).size((image.shape[1], image.shape[0]))
            interpolation = cv2.INTER_AREA if self.pixel_aspect < 1.0 else cv2.INTER_LINEAR
            image = np.asarray(cv2.resize(image, upright, interpolation=interpolation), dtype=np.uint8)
        if not self.is_rotated:
            return image
        if self.transposed:
            image = image.transpose(1, 0, 2)
        if self.mirrored_x:
            image = image[:, ::-1]
        if self.mirrored_y:
            image = image[::-1]
        return np.ascontiguousarray(image)


_QUARTERS = (
    Orientation(),
    Orientation(transposed=True, mirrored_y=True),
    Orientation(mirrored_x=True, mirrored_y=True),
    Orientation(transposed=True, mirrored_x=True),
)
"""By quarter turns, counterclockwise."""


def parse_orientation(picture: VideoFrame, pixel_aspect: float = 1.0) -> Orientation:
    """Parse a picture's display matrix (ISO/IEC 14496-12, 6.2.2; an EXIF orientation becomes one, too).

    Rotations are rounded to quarter turns. Of a photo's EXIF only the rotation is available.
    """
    try:
        matrix = picture.side_data.get(_MATRIX_NAME)
    except ValueError:  # PyAV does not know some other side data, such as a photo's EXIF
        return replace(_QUARTERS[round(picture.rotation / 90) % 4], pixel_aspect=pixel_aspect)
    data = bytes(matrix) if isinstance(matrix, SideData) else b""
    if len(data) != _MATRIX.size:
        return Orientation(pixel_aspect=pixel_aspect)
    # The matrix maps (x, y) to (a x + c y, b x + d y).
    a, b, _, c, d, *_ = _MATRIX.unpack(data)
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return Orientation(mirrored_x=a < 0, mirrored_y=d < 0, pixel_aspect=pixel_aspect)
    return Orientation(transposed=True, mirrored_x=c < 0, mirrored_y=b < 0, pixel_aspect=pixel_aspect)


def pixel_aspect(stream: VideoStream) -> float:
    """Return the width of a stored pixel over its height; 1 where nothing plausible is declared."""
    declared = stream.sample_aspect_ratio
    aspect = float(declared) if declared else 1.0
    is_plausible = 1.0 / _MAX_ASPECT <= aspect <= _MAX_ASPECT
    return aspect if is_plausible and abs(aspect - 1.0) > _SQUARE else 1.0
