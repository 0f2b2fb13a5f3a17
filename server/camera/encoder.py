"""Encodes a camera's frames once, in closed GOPs that begin at the same pulses in every camera.

The encoders are set up so that the same frames give the same bytes, and none is held back.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import av
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType
from numpy.typing import NDArray

from server.media.color_conversion import to_yuv
from server.media.rendering_messages import RenderSettings
from server.system.errors import UserError

if TYPE_CHECKING:  # a render worker must start fast, without the configuration's libraries
    from server.config.sections import EncodeSettings, SiteSettings

_CLOCK = Fraction(1, 90_000)
_NO_KEYFRAMES = 1_000_000
"""The encoder's own keyframe interval, never reached: keyframes follow from the pulses."""
_MAX_BUFFER_S = 0.5
_UNLIMITED_BITRATE = 1_000_000_000
"""Bits per second that VP8 never reaches: the quantizer alone determines the rate."""


@dataclass(frozen=True, slots=True)
class AccessUnit:
    """One encoded frame: H.264 or H.265 in Annex B, a keyframe with its parameter sets; or VP8."""

    pulse: int
    key: bool
    data: bytes
    reference_pulse: int | None = None
    """The pulse of the access unit that it references; None: unknown. A keyframe's has no meaning."""


class Encoder:
    """Returns one access unit for each frame, without delay.

    Parameter sets depend on the site's configuration alone, so they are equal in all cameras, and a decoder
    sees a cut between cameras as an ordinary GOP boundary. With :class:`RenderSettings` it encodes H.264.

    Raises:
        UserError: FFmpeg has no such encoder here.
    """

    def __init__(
        self, site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings
    ) -> None:
        self._gop = _frames_per_gop(site, settings)
        self._fps = site.fps
        self._last: int | None = None
        if (
            isinstance(site, RenderSettings)
            or isinstance(settings, RenderSettings)
            or settings.codec == "h264"
        ):
            self._context = _open_x264(site, settings)
        elif settings.codec == "h265":
            self._context = _open_x265(site, settings)
        else:
            self._context = _open_libvpx(site, settings)

    def encode(self, pulse: int, image: NDArray[np.uint8]) -> AccessUnit:
        """Encode the image of a pulse, ``(height, width, 3)`` BGR of the site's size."""
        key = self._last is None or pulse // self._gop != self._last // self._gop
        frame = to_yuv(image)
        frame.pts = round(pulse * _CLOCK.denominator / self._fps)
        frame.time_base = _CLOCK
        frame.pict_type = PictureType.I if key else PictureType.NONE
        data = b"".join(bytes(packet) for packet in self._context.encode(frame))
        reference_pulse, self._last = self._last, pulse
        return AccessUnit(pulse, key, data, reference_pulse)


def _open_x264(
    site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings
) -> VideoCodecContext:
    return _open_x26x(_create_context("libx264", site), site, settings, "x264-params", "")


def _open_x265(site: SiteSettings, settings: EncodeSettings) -> VideoCodecContext:
    try:
        context = _create_context("libx265", site)
    except av.codec.codec.UnknownCodecError:
        raise UserError(
            "encode.codec: h265: PyAV has no libx265 here to encode cameras; "
            "let all cameras pass through (passthrough: pass), or use h264"
        ) from None
    # Pools of threads would delay frames.
    quiet = ":info=0:log-level=none:pools=none:frame-threads=1"
    return _open_x26x(context, site, settings, "x265-params", quiet)


def _open_x26x(
    context: VideoCodecContext,
    site: SiteSettings | RenderSettings,
    settings: EncodeSettings | RenderSettings,
    option: str,
    parameters: str,
) -> VideoCodecContext:
    """Open x264 or x265, whose own parameters are an option of FFmpeg's."""
    common = "scenecut=0:open-gop=0:repeat-headers=1:colormatrix=smpte170m"
    context.max_b_frames = 0
    context.options = {
        "preset": settings.preset,
        "tune": "zerolatency",
        "crf": str(settings.crf),
        "forced-idr": "1",
        option: common + parameters + _rate_limit(site, settings),
    }
    context.open()
    return context


def _open_libvpx(site: SiteSettings, settings: EncodeSettings) -> VideoCodecContext:
    context = _create_context("libvpx", site)
    context.bit_rate = _UNLIMITED_BITRATE
    context.options = {
        "deadline": "realtime",
        # Negative: a fixed speed. Positive: libvpx adapts to the clock, and no two runs give the same bytes.
        "cpu-used": str(-settings.speed),
        "qmin": str(settings.quantizer),
        "qmax": str(settings.quantizer),
        "keyint_min": str(_NO_KEYFRAMES),  # equal to the maximum: no keyframes at scene cuts
        "lag-in-frames": "0",
        "auto-alt-ref": "0",
    }
    context.open()
    return context


def _create_context(name: str, site: SiteSettings | RenderSettings) -> VideoCodecContext:
    context = av.CodecContext.create(name, "w")
    assert isinstance(context, VideoCodecContext)  # noqa: S101 — tells mypy what an encoder is
    context.width, context.height, context.pix_fmt = site.width, site.height, "yuv420p"
    context.time_base = _CLOCK
    # Without a frame rate x264 assumes that of the time base, and starves every frame of bits.
    context.framerate = Fraction(site.fps).limit_denominator(1001)
    context.thread_count = 1  # more threads would mean more slices or delay
    context.gop_size = _NO_KEYFRAMES
    return context


def _frames_per_gop(site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings) -> int:
    return settings.gop if isinstance(settings, RenderSettings) else settings.frames_per_gop(site.fps)


def _rate_limit(site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings) -> str:
    """Return x264's and x265's VBV parameters that keep every second below ``max_kbps`` (H.264, annex C).

    In one second a full buffer and the fill rate pass at once, so the rate is ``max_kbps / (1 + buffer
    seconds)``. The buffer holds a GOP, up to half a second, since a keyframe is larger than other frames.
    """
    if settings.max_kbps is None:
        return ""
    buffer_s = min(_frames_per_gop(site, settings) / site.fps, _MAX_BUFFER_S)
    rate = settings.max_kbps / (1 + buffer_s)
    return f":vbv-maxrate={max(1, int(rate))}:vbv-bufsize={max(1, int(rate * buffer_s))}"
