"""H.264 as a codec of NAL units (:mod:`server.media.nal_codec`)."""

from __future__ import annotations

from collections.abc import Sequence

from server.media.h264 import annexb
from server.media.h264.continuity import PictureContinuity
from server.media.h264.gap_filler import H264GapFiller
from server.media.h264.gray_picture import gray_picture
from server.media.h264.repeat_picture import parse_repeatable
from server.media.parameter_sets import ParameterSets, UnsupportedParametersError
from server.media.picture import Codec


class H264Codec:
    """The functions of this package."""

    name: Codec = "h264"
    title = "H.264"
    ffmpeg_name = "h264"

    def select_sets(self, units: Sequence[bytes]) -> list[bytes]:
        """Return those NAL units that are parameter sets."""
        return [unit for unit in units if annexb.nal_type(unit) in (annexb.NAL_SPS, annexb.NAL_PPS)]

    def continuity(self) -> PictureContinuity:
        """Return the continuity check of a stream that begins."""
        return PictureContinuity()

    def parameter_sets(self, units: Sequence[bytes]) -> ParameterSets | None:
        """Return the parameter sets among NAL units; None if one is missing or invalid."""
        return annexb.parameter_sets(units)

    def is_keyframe(self, units: Sequence[bytes]) -> bool:
        """Return whether an access unit can be decoded without earlier ones."""
        return any(annexb.nal_type(unit) == annexb.NAL_IDR for unit in units)

    def join_sample(self, units: Sequence[bytes]) -> bytes:
        """Return NAL units as an MP4 sample, without access unit delimiters."""
        return annexb.join_sample(units)

    def check_supported(self, parameters: ParameterSets) -> None:
        """Do nothing: where a gap cannot be filled, a picture lasts longer."""

    def may_reorder(self, parameters: ParameterSets | None) -> bool:
        """Return True: they may not tell."""
        del parameters
        return True

    def is_in_order(self, units: Sequence[bytes], parameters: ParameterSets | None) -> bool:
        """Return True: it is not in the header."""
        del units, parameters
        return True

    def gray_picture(self, parameters: ParameterSets, number: int) -> bytes:
        """Return the sample of a gray keyframe.

        Raises:
            UnsupportedParametersError: the parameter sets are damaged, or use rare features.
        """
        return gray_picture(_own(parameters), number)

    def gap_filler(
        self, parameters: ParameterSets, fps: float, attached: ParameterSets | None = None
    ) -> H264GapFiller:
        """Return the gap filler for these parameter sets.

        Raises:
            UnsupportedParametersError: they are damaged, or use features that are not supported.
        """
        return H264GapFiller(parse_repeatable(_own(parameters)), fps, attached)


def _own(parameters: ParameterSets) -> annexb.H264ParameterSets:
    if not isinstance(parameters, annexb.H264ParameterSets):
        raise UnsupportedParametersError("they are not of H.264")
    return parameters


H264 = H264Codec()
