"""The encoders themselves, set up so that the same pictures give the same bytes and nothing is held back."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import av
from av.video.codeccontext import VideoCodecContext

from server.media.rendering_messages import RenderSettings

if TYPE_CHECKING:  # a drawing process encodes too, and has no second to load the configuration's libraries
    from server.config.sections import EncodeSettings, SiteSettings

CLOCK = Fraction(1, 90_000)
_FAR = 1_000_000
"""Frames between the encoder's own key frames: never, they come from the pulse numbers."""
_LONGEST_BUFFER_S = 0.5
_BITS_TO_SPARE = 1_000_000_000
"""A rate that VP8 never reaches: the quantizer alone says how many bits there are."""


def x264(site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings) -> VideoCodecContext:
    """Return an encoder of H.264."""
    context = _opened_by("libx264", site)
    context.max_b_frames = 0
    context.options = {
        "preset": settings.preset,
        "tune": "zerolatency",
        "crf": str(settings.crf),
        "forced-idr": "1",
        "x264-params": "scenecut=0:open-gop=0:repeat-headers=1:colormatrix=smpte170m" + _cap(site, settings),
    }
    context.open()
    return context


def libvpx(site: SiteSettings, settings: EncodeSettings) -> VideoCodecContext:
    """Return an encoder of VP8."""
    context = _opened_by("libvpx", site)
    context.bit_rate = _BITS_TO_SPARE
    context.options = {
        "deadline": "realtime",
        # Below 0 it is a speed; above it libvpx would look at the clock, and no two runs would be alike.
        "cpu-used": str(-settings.speed),
        "qmin": str(settings.quantizer),
        "qmax": str(settings.quantizer),
        "keyint_min": str(_FAR),  # as long as the longest: no key frames at what it takes for scene cuts
        "lag-in-frames": "0",
        "auto-alt-ref": "0",
    }
    context.open()
    return context


def _opened_by(name: str, site: SiteSettings | RenderSettings) -> VideoCodecContext:
    context = av.CodecContext.create(name, "w")
    assert isinstance(context, VideoCodecContext)  # noqa: S101 — tells mypy what an encoder is
    context.width, context.height, context.pix_fmt = site.width, site.height, "yuv420p"
    context.time_base = CLOCK
    # Without the frame rate x264 takes the time base for it and starves every frame of bits.
    context.framerate = Fraction(site.fps).limit_denominator(1001)
    context.thread_count = 1  # more threads would mean more slices or delay
    context.gop_size = _FAR
    return context


def _cap(site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings) -> str:
    """Return x264 a leaky bucket (H.264, annex C) that lets no more than the cap through in any second.

    A bucket that fills at a rate and holds so many seconds of it lets both through at once. It holds a GOP,
    so that a key picture may take much of what the others leave.
    """
    if settings.max_kbps is None:
        return ""
    holds_s = min(settings.gop / site.fps, _LONGEST_BUFFER_S)
    rate = settings.max_kbps / (1 + holds_s)
    return f":vbv-maxrate={max(1, int(rate))}:vbv-bufsize={max(1, int(rate * holds_s))}"
