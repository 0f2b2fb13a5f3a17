"""Check whether a camera's own video can be passed through into the site's streams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from server.camera.encoder import Encoder
from server.camera.sources.frame_timing import frame_index
from server.camera.sources.opening import OpenedVideo
from server.camera.sources.orientation import Orientation
from server.config.site_config import Config
from server.media.codec import nal_codec
from server.media.nal_codec import NalCodec
from server.media.nal_units import nal_units
from server.media.parameter_sets import ParameterSets, UnsupportedParametersError

_SAME_RATE = 0.03
"""Relative deviation allowed of a camera's declared rate, which is often rounded."""


OR_ENCODE = "change the camera's settings, or let it be encoded (passthrough: auto)"
"""What to do about a camera that cannot be passed through."""


class IncompatibleStreamError(Exception):
    """The camera's stream cannot be passed through; the text says why."""


@dataclass(frozen=True, slots=True)
class RequiredFormat:
    """The format that every camera of a site sends."""

    size: tuple[int, int]
    fps: float
    gop: int
    codec: NalCodec
    parameters: ParameterSets | None
    """Those of the re-encoded cameras; None: there are none, and the cameras' own must agree."""


def required_format(config: Config) -> RequiredFormat:
    """Return the format that a site requires."""
    site = config.site
    parameters, codec = None, nal_codec(config.encode.codec)
    encoding = any(camera.passthrough != "pass" for camera in config.cameras)
    if encoding and config.encode.parameters == "equal":
        black = np.zeros((site.height, site.width, 3), dtype=np.uint8)
        first = Encoder(site, config.encode).encode(0, black)
        parameters = codec.parameter_sets(nal_units(first.data))
    return RequiredFormat((site.width, site.height), site.fps, config.gop, codec, parameters)


class CompatibilityCheck:
    """Checks a video and its access units, one after the other."""

    def __init__(self, required: RequiredFormat) -> None:
        self._required = required
        self._parameters = required.parameters
        self._shown: int | None = None

    def check_video(self, opened: OpenedVideo) -> None:
        """Check a video's declared codec, size and rate.

        Raises:
            IncompatibleStreamError: it does not fit.
        """
        required, codec = self._required, opened.stream.codec_context.name
        if codec != required.codec.ffmpeg_name:
            sent = {"h264": "H.264", "hevc": "H.265"}.get(codec, codec)
            raise IncompatibleStreamError(f"it is {sent}, not {required.codec.title} (encode.codec)")
        if opened.size != required.size:
            camera_size, site_size = ("x".join(map(str, size)) for size in (opened.size, required.size))
            raise IncompatibleStreamError(
                f"its frames are {camera_size}, the site's {site_size} (site.width, site.height)"
            )
        rate = opened.stream.average_rate
        if rate and abs(float(rate) / required.fps - 1) > _SAME_RATE:
            raise IncompatibleStreamError(
                f"it has {float(rate):g} frames a second, the site {required.fps:g} (site.fps)"
            )

    def check_orientation(self, orientation: Orientation) -> None:
        """Check the orientation.

        Raises:
            IncompatibleStreamError: images must be rotated or stretched, which the streams cannot express.
        """
        if orientation.description:
            raise IncompatibleStreamError(f"it is shown {orientation.description}")

    def check_frame_time(self, frame: int, seconds: float) -> None:
        """Check the time of a recording's frame, in seconds after its first one.

        Raises:
            IncompatibleStreamError: it belongs to another pulse than the one it would be sent at.
        """
        if (place := frame_index(seconds, self._required.fps)) != frame:
            raise IncompatibleStreamError(
                f"frame {frame} is shown at {seconds:.2f} s, which is frame {place} at the site's "
                f"{self._required.fps:g} frames a second (site.fps)"
            )

    def check_access_unit(
        self, frame: int, pulse: int, data: bytes, shown: int | None, decoded: int | None
    ) -> None:
        """Check the next access unit; ``shown`` and ``decoded`` are its time stamps, if any.

        Raises:
            IncompatibleStreamError: it does not fit.
        """
        gop, codec, units = self._required.gop, self._required.codec, nal_units(data)
        goes_back = shown is not None and self._shown is not None and shown <= self._shown
        is_late = None not in (shown, decoded) and shown != decoded and codec.may_reorder(self._parameters)
        if goes_back or is_late or not codec.is_in_order(units, self._parameters):
            raise IncompatibleStreamError(
                f"frame {frame} is decoded and shown in another order: it has B frames"
            )
        self._shown = shown
        if codec.is_keyframe(units) != (pulse % gop == 0):
            problem = (
                "begins a GOP, but none of the site's GOPs begins there"
                if pulse % gop
                else "does not begin a GOP"
            )
            raise IncompatibleStreamError(
                f"frame {frame} {problem}: they begin every {gop} frames (encode.gop_s)"
            )
        if pulse % gop == 0:
            self._check_parameters(frame, codec.parameter_sets(units))

    def _check_parameters(self, frame: int, found: ParameterSets | None) -> None:
        if found is None:
            raise IncompatibleStreamError(
                f"frame {frame} begins a GOP without one set of parameters of each kind"
            )
        if self._parameters is None:
            self._parameters = found
            try:
                self._required.codec.check_supported(found)
            except UnsupportedParametersError as error:
                raise IncompatibleStreamError(f"its parameter sets are not supported: {error}") from error
        elif found != self._parameters:
            expected = (
                "those that this site encodes with" if self._required.parameters else "at its beginning"
            )
            raise IncompatibleStreamError(
                f"frame {frame} has other parameter sets (SPS, PPS) than {expected}"
            )
