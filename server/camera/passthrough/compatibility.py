"""Whether a camera's own H.264 may stand in the site's streams, beside what other cameras encode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from server.camera.encoding.encoder import Encoder
from server.camera.passthrough.access_units import is_keyframe
from server.camera.sources.frame_timing import frame_index
from server.camera.sources.opening import OpenedVideo
from server.camera.sources.orientation import Orientation
from server.config.site_config import Config
from server.media.h264.annexb import ParameterSets, nal_units, parameter_sets

_SAME_RATE = 0.03
"""Part by which a camera's rate may be off the site's: cameras say it in round numbers."""


class IncompatibleStreamError(Exception):
    """The camera's stream cannot be passed through; the text says why."""


@dataclass(frozen=True, slots=True)
class RequiredFormat:
    """The format that every camera of a site sends."""

    size: tuple[int, int]
    fps: float
    gop: int
    parameters: ParameterSets | None
    """Those of the cameras that encode; None: none does, and the cameras only have to agree."""


def required_format(config: Config) -> RequiredFormat:
    """Return the format that a site requires."""
    site = config.site
    parameters = None
    encoding = any(camera.h264 != "pass" for camera in config.cameras)
    if encoding and config.encode.parameters == "equal":
        blank = np.zeros((site.height, site.width, 3), dtype=np.uint8)
        first = Encoder(site, config.encode).encode(0, blank)
        parameters = parameter_sets(nal_units(first.data))
    return RequiredFormat((site.width, site.height), site.fps, config.encode.gop, parameters)


class CompatibilityCheck:
    """Checks a video and its access units, one after the other."""

    def __init__(self, wanted: RequiredFormat) -> None:
        self._wanted = wanted
        self._parameters = wanted.parameters
        self._shown: int | None = None

    def opened(self, opened: OpenedVideo) -> None:
        """Look at what a video says of itself.

        Raises:
            IncompatibleStreamError: it does not fit.
        """
        wanted, codec = self._wanted, opened.stream.codec_context.name
        if codec != "h264":
            raise IncompatibleStreamError(f"it is {codec}, not H.264")
        if opened.size != wanted.size:
            own, site = ("x".join(map(str, size)) for size in (opened.size, wanted.size))
            raise IncompatibleStreamError(
                f"its pictures are {own}, the site's {site} (site.width, site.height)"
            )
        rate = opened.stream.average_rate
        if rate and abs(float(rate) / wanted.fps - 1) > _SAME_RATE:
            raise IncompatibleStreamError(
                f"it has {float(rate):g} pictures a second, the site {wanted.fps:g} (site.fps)"
            )

    def lies(self, orientation: Orientation) -> None:
        """Look at how its pictures are shown.

        Raises:
            IncompatibleStreamError: not as they are stored, and nothing in a site's streams says so.
        """
        if orientation.words:
            raise IncompatibleStreamError(f"its pictures are shown {orientation.words}")

    def at(self, frame: int, seconds: float) -> None:
        """Look at when a frame of a recording is shown, after its first one.

        Raises:
            IncompatibleStreamError: at another pulse than the one that it would be passed on at.
        """
        if (place := frame_index(seconds, self._wanted.fps)) != frame:
            raise IncompatibleStreamError(
                f"frame {frame} is shown at {seconds:.2f} s, which is frame {place} at the site's "
                f"{self._wanted.fps:g} pictures a second (site.fps)"
            )

    def unit(self, frame: int, pulse: int, data: bytes, shown: int | None, decoded: int | None) -> None:
        """Look at the next access unit; ``shown`` and ``decoded`` are its times, where it has any.

        Raises:
            IncompatibleStreamError: it does not fit.
        """
        gop = self._wanted.gop
        later = shown is not None and self._shown is not None and shown <= self._shown
        if later or (shown is not None and decoded is not None and shown != decoded):
            raise IncompatibleStreamError(
                f"frame {frame} is decoded and shown in another order: it has B pictures"
            )
        self._shown = shown
        if is_keyframe(data) != (pulse % gop == 0):
            does = "begins a GOP, where none of the site does" if pulse % gop else "does not begin a GOP"
            raise IncompatibleStreamError(f"frame {frame} {does}: they begin every {gop} frames (encode.gop)")
        if pulse % gop == 0:
            self._key(frame, parameter_sets(nal_units(data)))

    def _key(self, frame: int, found: ParameterSets | None) -> None:
        if found is None:
            raise IncompatibleStreamError(f"frame {frame} begins a GOP without parameter sets")
        if self._parameters is None:
            self._parameters = found
        elif found != self._parameters:
            whose = "this site encodes with" if self._wanted.parameters else "it began with"
            raise IncompatibleStreamError(f"frame {frame} has other parameter sets (SPS, PPS) than {whose}")
