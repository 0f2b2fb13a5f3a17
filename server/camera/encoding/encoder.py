"""Encode once: closed GOPs that begin at the same pulses in every camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from av.video.frame import PictureType
from numpy.typing import NDArray

from server.camera.encoding.codecs import CLOCK, libvpx, x264
from server.media.color_conversion import to_yuv
from server.media.rendering_messages import RenderSettings

if TYPE_CHECKING:  # a drawing process encodes too, and has no second to load the configuration's libraries
    from server.config.sections import EncodeSettings, SiteSettings


@dataclass(frozen=True, slots=True)
class AccessUnit:
    """One encoded picture: H.264 in Annex B, a key one with SPS and PPS; or a frame of VP8."""

    pulse: int
    key: bool
    data: bytes
    after: int | None = None
    """The pulse of the one before it, which it is decoded by; None: it is not known."""


class Encoder:
    """One frame in, one access unit out, no delay.

    All that shapes SPS and PPS comes from the site's configuration, so that they are equal in all cameras: a
    decoder takes a cut between cameras for an ordinary GOP boundary. What is drawn on a canvas is H.264.
    """

    def __init__(
        self, site: SiteSettings | RenderSettings, settings: EncodeSettings | RenderSettings
    ) -> None:
        self._gop = settings.gop
        self._fps = site.fps
        self._last: int | None = None
        if (
            isinstance(site, RenderSettings)
            or isinstance(settings, RenderSettings)
            or settings.codec == "h264"
        ):
            self._context = x264(site, settings)
        else:
            self._context = libvpx(site, settings)

    def encode(self, pulse: int, image: NDArray[np.uint8]) -> AccessUnit:
        """Encode the picture, ``(height, width, 3)`` BGR of the site's size, of one pulse."""
        key = self._last is None or pulse // self._gop != self._last // self._gop
        frame = to_yuv(image)
        frame.pts = round(pulse * CLOCK.denominator / self._fps)
        frame.time_base = CLOCK
        frame.pict_type = PictureType.I if key else PictureType.NONE
        data = b"".join(bytes(packet) for packet in self._context.encode(frame))
        before, self._last = self._last, pulse
        return AccessUnit(pulse, key, data, before)
