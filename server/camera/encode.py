"""Encode once: H.264 in closed GOPs that begin at the same pulses in every camera."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import av
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType, VideoFrame
from numpy.typing import NDArray

from server.wire.drawing import Canvas

if TYPE_CHECKING:  # a drawing process encodes too, and has no second to load the configuration's libraries
    from server.wire.sections import Encode, Site

_CLOCK = Fraction(1, 90_000)
_FAR = 1_000_000
"""Frames between x264's own key frames: never, they come from the pulse numbers."""
_LONGEST_BUFFER_S = 0.5


@dataclass(frozen=True, slots=True)
class AccessUnit:
    """One encoded picture, Annex B; a key one carries SPS and PPS."""

    pulse: int
    key: bool
    data: bytes


class Encoder:
    """One frame in, one access unit out, no delay.

    All that shapes SPS and PPS comes from the site's configuration, so that they are equal in all cameras: a
    decoder takes a cut between cameras for an ordinary GOP boundary.
    """

    def __init__(self, site: Site | Canvas, settings: Encode | Canvas) -> None:
        self._gop = settings.gop
        self._fps = site.fps
        self._last: int | None = None
        context = av.CodecContext.create("libx264", "w")
        assert isinstance(context, VideoCodecContext)  # noqa: S101 — tells mypy what libx264 is
        context.width, context.height, context.pix_fmt = site.width, site.height, "yuv420p"
        context.time_base = _CLOCK
        # Without the frame rate x264 takes the time base for it and starves every frame of bits.
        context.framerate = Fraction(site.fps).limit_denominator(1001)
        context.thread_count = 1  # more threads would mean more slices or delay
        context.max_b_frames = 0
        context.gop_size = _FAR
        context.options = {
            "preset": settings.preset,
            "tune": "zerolatency",
            "crf": str(settings.crf),
            "forced-idr": "1",
            "x264-params": "scenecut=0:open-gop=0:repeat-headers=1:colormatrix=smpte170m"
            + _cap(site, settings),
        }
        context.open()
        self._context = context

    def encode(self, pulse: int, image: NDArray[np.uint8]) -> AccessUnit:
        """Encode the picture, ``(height, width, 3)`` BGR of the site's size, of one pulse."""
        key = self._last is None or pulse // self._gop != self._last // self._gop
        frame = VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
        frame.pts = round(pulse * 90_000 / self._fps)
        frame.time_base = _CLOCK
        frame.pict_type = PictureType.I if key else PictureType.NONE
        data = b"".join(bytes(packet) for packet in self._context.encode(frame))
        self._last = pulse
        return AccessUnit(pulse, key, data)


def _cap(site: Site | Canvas, settings: Encode | Canvas) -> str:
    """Give x264 a leaky bucket (H.264, annex C) that lets no more than the cap through in any second.

    A bucket that fills at a rate and holds so many seconds of it lets both through at once. It holds a GOP,
    so that a key picture may take much of what the others leave.
    """
    if settings.max_kbps is None:
        return ""
    holds_s = min(settings.gop / site.fps, _LONGEST_BUFFER_S)
    rate = settings.max_kbps / (1 + holds_s)
    return f":vbv-maxrate={max(1, int(rate))}:vbv-bufsize={max(1, int(rate * holds_s))}"
