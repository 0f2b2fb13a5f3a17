"""What the best-view service and a drawing process say to each other, over the process's pipes.

One request, one answer, each a msgpack message behind its length. The first message is :class:`Canvas`; its
answer is :data:`READY`. This module does not load the configuration: a drawing process must start at once.
"""

from __future__ import annotations

from typing import Literal

import msgspec

Boxes = list[list[tuple[int, float, float, float, float]]]
"""For every frame of a GOP: object, left, top, right, bottom; as in ``GopChoices``."""

Still = Literal["plain", "boxed"]

LENGTH_BYTES = 4
"""The length before every message, big-endian."""
READY = bytes(LENGTH_BYTES)
"""What a drawing process writes when it has loaded its libraries: an empty message."""
TIMESCALE = 90_000
"""Ticks a second in fragments of MP4: divisible by 24, 25, 30 and 50 frames a second."""


class Canvas(msgspec.Struct, frozen=True, kw_only=True):
    """What all pictures of a site share; all that shapes the parameter sets of H.264 is the cameras' own."""

    codec: Literal["h264", "vp8"] = "h264"
    """Of the frames to decode; what is encoded is H.264."""
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
    """Frames to decode, and what to make of them."""

    fragments: bytes = b""
    """Fragments (or clusters) of consecutive frames; of the first request, they begin with a key frame."""
    first: int = 0
    """The pulse that ``boxes`` begin with."""
    boxes: Boxes = []
    chosen: int | None = None
    """The object whose box stands out."""
    film: bool = False
    """Wanted: the frames with boxes, encoded."""
    plain: list[float] = []
    """Wanted: JPEG at these rates, a second (:func:`is_in_series`)."""
    boxed: list[float] = []
    """Wanted: JPEG with boxes, likewise."""
    still: Still | None = None
    """Wanted: JPEG of the last frame that was decoded, in this request or before."""


class EncodedFrame(msgspec.Struct, frozen=True):
    """One encoded frame, Annex B; a key one carries SPS and PPS."""

    pulse: int
    key: bool
    data: bytes
    lasts: int = 1
    """Pulses that it is shown for."""


class JpegPicture(msgspec.Struct, frozen=True):
    """One JPEG."""

    pulse: int
    data: bytes


class RenderResult(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to :class:`RenderRequest`."""

    newest: int
    """The last frame that was decoded, now or before; -1: none."""
    film: list[EncodedFrame] = []
    plain: list[JpegPicture] = []
    boxed: list[JpegPicture] = []
    still: JpegPicture | None = None


def is_in_series(pulse: int, rate: float, fps: float) -> bool:
    """Return whether a frame belongs to a series of ``rate`` pictures a second out of ``fps``.

    It depends on the pulse alone, so that series share pictures, and a slower one is part of a faster one
    whose rate is a multiple.
    """
    return rate >= fps or pulse * rate // fps != (pulse - 1) * rate // fps


def encode_message(message: msgspec.Struct) -> bytes:
    """Encode a message behind its length, as it goes through a pipe."""
    body = msgspec.msgpack.encode(message)
    return len(body).to_bytes(LENGTH_BYTES, "big") + body
