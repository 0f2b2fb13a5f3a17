"""What the formats of streams need to know of a codec of NAL units, H.264 or H.265."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from server.media.gap_filler import GapFiller
from server.media.parameter_sets import ParameterSets
from server.media.picture import Codec


class Continuity(Protocol):
    """Finds lost pictures of a stream without decoding it."""

    def follows(self, access_unit: bytes) -> bool:
        """Return whether an access unit, Annex B, has its beginning and follows the last one."""


class NalCodec(Protocol):
    """Parses access units, and writes pictures of its own."""

    @property
    def name(self) -> Codec:
        """The codec."""

    @property
    def title(self) -> str:
        """The codec's name for people."""

    @property
    def ffmpeg_name(self) -> str:
        """The name of FFmpeg's decoder."""

    def select_sets(self, units: Sequence[bytes]) -> list[bytes]:
        """Return those NAL units that are parameter sets."""

    def continuity(self) -> Continuity:
        """Return the continuity check of a stream that begins."""

    def parameter_sets(self, units: Sequence[bytes]) -> ParameterSets | None:
        """Return the parameter sets among NAL units; None if one is missing or invalid."""

    def is_keyframe(self, units: Sequence[bytes]) -> bool:
        """Return whether an access unit can be decoded without earlier ones."""

    def join_sample(self, units: Sequence[bytes]) -> bytes:
        """Return NAL units as an MP4 sample, with parameter sets but without access unit delimiters."""

    def check_supported(self, parameters: ParameterSets) -> None:
        """Check that gaps can be filled in streams of these parameter sets.

        Raises:
            UnsupportedParametersError: they cannot, and why.
        """

    def may_reorder(self, parameters: ParameterSets | None) -> bool:
        """Return whether these parameter sets allow pictures that are shown in another order than decoded."""

    def is_in_order(self, units: Sequence[bytes], parameters: ParameterSets | None) -> bool:
        """Return whether the picture does not refer to later ones, as far as its slice header tells."""

    def gray_picture(self, parameters: ParameterSets, number: int) -> bytes:
        """Return the sample of a gray keyframe; ``number``, 0 or 1, differs between two in a row.

        Raises:
            UnsupportedParametersError: the parameter sets are damaged, or use rare features.
        """

    def gap_filler(
        self, parameters: ParameterSets, fps: float, attached: ParameterSets | None = None
    ) -> GapFiller:
        """Return the gap filler for these parameter sets; ``attached`` are set in its pictures.

        Raises:
            UnsupportedParametersError: they are damaged, or use features that are not supported.
        """
