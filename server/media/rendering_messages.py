"""Messages between the service and a render worker (:mod:`server.system.worker`).

This module does not import the configuration: a worker must start fast.
"""

from __future__ import annotations

from typing import Literal

import msgspec

Boxes = list[list[tuple[int, float, float, float, float]]]
"""By frame of a GOP: (object, left, top, right, bottom), as in ``GopChoices``."""

PictureKind = Literal["plain", "boxed"]

Region = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels of the site's picture."""

WHOLE_PICTURE: Region = (0.0, 0.0, 1e6, 1e6)
"""The region that is every picture."""

TIMESCALE = 90_000
"""Ticks per second in MP4 fragments: divisible by 24, 25, 30 and 50 frames per second."""


class RenderSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Size, rate and encoder settings of a site's video; the worker encodes H.264 as the cameras do."""

    input_codec: Literal["h264", "h265", "vp8"] = "h264"
    """The codec of the frames to decode; the worker always encodes H.264."""
    width: int
    height: int
    fps: float
    gop: int
    preset: str
    crf: float
    max_kbps: int | None
    jpeg_quality: int
    """0 to 100."""


class RenderRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Frames to decode, and the outputs to render from them."""

    fragments: bytes = b""
    """MP4 fragments or WebM clusters of consecutive frames; the first request begins with a keyframe."""
    first: int = 0
    """The pulse of the first entry in ``boxes``."""
    boxes: Boxes = []
    chosen: int | None = None
    """The object whose box is highlighted."""
    hidden: list[list[Region]] | None = None
    """By frame as in ``boxes``: the regions to pixelate; in other frames the whole picture. Null: nothing."""
    video: PictureKind | None = None
    """The kind of the frames to encode as video; null: none."""
    plain: list[float] = []
    """Rates, in pictures per second, at which to encode JPEG pictures (:func:`is_at_rate`)."""
    boxed: list[float] = []
    """Rates for JPEG pictures with boxes."""
    still: PictureKind | None = None
    """The kind of JPEG picture to encode of the last decoded frame, of this request or an earlier one."""


class EncodedFrame(msgspec.Struct, frozen=True):
    """One encoded frame, Annex B; a keyframe carries SPS and PPS."""

    pulse: int
    key: bool
    data: bytes
    duration: int = 1
    """The number of pulses it is shown for."""


class JpegPicture(msgspec.Struct, frozen=True):
    """One JPEG picture."""

    pulse: int
    data: bytes


class RenderResult(msgspec.Struct, frozen=True, kw_only=True):
    """The response to :class:`RenderRequest`."""

    newest: int
    """The pulse of the last decoded frame, of this request or an earlier one; -1: none."""
    video: list[EncodedFrame] = []
    plain: list[JpegPicture] = []
    boxed: list[JpegPicture] = []
    still: JpegPicture | None = None


def is_at_rate(pulse: int, rate: float, fps: float) -> bool:
    """Return whether a frame is one of the ``rate`` per second that are selected out of ``fps``.

    It depends on the pulse alone, so that streams of one rate share pictures, and the pictures of a rate are
    among those of its multiples.
    """
    return rate >= fps or pulse * rate // fps != (pulse - 1) * rate // fps
