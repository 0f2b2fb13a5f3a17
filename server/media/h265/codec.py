"""H.265 as a codec of NAL units (:mod:`server.media.nal_codec`)."""

from __future__ import annotations

from collections.abc import Sequence

from server.media.h265 import nal
from server.media.h265.continuity import ReferenceContinuity
from server.media.h265.gap_filler import H265GapFiller
from server.media.h265.gray_picture import gray_keyframe
from server.media.h265.parameter_sets import H265ParameterSets, parameter_sets
from server.media.h265.repeat_picture import parse_repeatable_syntax
from server.media.h265.slice_header import read_picture_order
from server.media.parameter_sets import ParameterSets, UnsupportedParametersError
from server.media.picture import Codec


class H265Codec:
    """The functions of this package."""

    name: Codec = "h265"
    title = "H.265"
    ffmpeg_name = "hevc"

    def select_sets(self, units: Sequence[bytes]) -> list[bytes]:
        """Return those NAL units that are parameter sets."""
        return [unit for unit in units if nal.nal_type(unit) in (nal.NAL_VPS, nal.NAL_SPS, nal.NAL_PPS)]

    def continuity(self) -> ReferenceContinuity:
        """Return the continuity check of a stream that begins."""
        return ReferenceContinuity()

    def parameter_sets(self, units: Sequence[bytes]) -> ParameterSets | None:
        """Return the parameter sets among NAL units; None if one is missing or invalid."""
        return parameter_sets(units)

    def is_keyframe(self, units: Sequence[bytes]) -> bool:
        """Return whether an access unit is an IDR picture.

        At others decoding can begin, too, but pictures around them may refer beyond them.
        """
        return any(nal.is_idr(unit) for unit in units)

    def join_sample(self, units: Sequence[bytes]) -> bytes:
        """Return NAL units as an MP4 sample, without access unit delimiters."""
        return nal.join_sample(units)

    def check_supported(self, parameters: ParameterSets) -> None:
        """Check that gaps can be filled in streams of these parameter sets.

        Raises:
            UnsupportedParametersError: they cannot, and why.
        """
        parse_repeatable_syntax(_own(parameters))

    def may_reorder(self, parameters: ParameterSets | None) -> bool:
        """Return whether a decoder must reorder pictures; FFmpeg guesses decoding times in Matroska."""
        try:
            return parameters is not None and _own(parameters).syntax.sequence.reorders
        except UnsupportedParametersError:
            return False

    def is_in_order(self, units: Sequence[bytes], parameters: ParameterSets | None) -> bool:
        """Return whether the picture does not refer to later ones, as far as its slice header tells."""
        if parameters is None:
            return True
        try:
            order = read_picture_order(nal.join_sample(units), _own(parameters).syntax)
        except (ValueError, UnsupportedParametersError):
            return True
        return all(reference.distance < 0 for reference in order.references)

    def gray_picture(self, parameters: ParameterSets, number: int) -> bytes:
        """Return the sample of a gray keyframe; two in a row may be equal.

        Raises:
            UnsupportedParametersError: the parameter sets are damaged, or use rare features.
        """
        del number
        return gray_keyframe(_own(parameters))

    def gap_filler(
        self, parameters: ParameterSets, fps: float, attached: ParameterSets | None = None
    ) -> H265GapFiller:
        """Return the gap filler for these parameter sets.

        Raises:
            UnsupportedParametersError: they are damaged, or use features that are not supported.
        """
        return H265GapFiller(parse_repeatable_syntax(_own(parameters)), fps, attached)


def _own(parameters: ParameterSets) -> H265ParameterSets:
    if not isinstance(parameters, H265ParameterSets):
        raise UnsupportedParametersError("they are not of H.265")
    return parameters


H265 = H265Codec()
