"""Selects the stream format of a site by its codec."""

from __future__ import annotations

from typing import Literal

from server.media.stream_format import PerCameraStreamFormat, StreamFormat
from server.media.vp8.stream_format import Vp8StreamFormat

Codec = Literal["h264", "vp8"]


def stream_format_for(
    codec: Codec, size: tuple[int, int], *, per_camera_parameters: bool = False
) -> StreamFormat:
    """Return the stream format of a site.

    ``size`` is (width, height) in pixels. ``per_camera_parameters``: H.264 parameter sets may differ among
    cameras.
    """
    if codec == "vp8":
        return Vp8StreamFormat(*size)
    return PerCameraStreamFormat() if per_camera_parameters else StreamFormat()
