"""The format that all streams of a site share: container, codec, parameter sets."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from server.media.audio.audio_format import AudioFormat
from server.media.containers.fmp4 import (
    FragmentSample,
    fragment,
    init_segment,
    sample_of,
    shift_fragment,
    ticks,
)
from server.media.gap_filler import NO_BOOT, GapFiller
from server.media.h264.codec import H264
from server.media.nal_codec import NalCodec
from server.media.nal_units import nal_units, split_sample
from server.media.parameter_sets import ParameterSets, UnsupportedParametersError
from server.media.picture import Codec, EncodedPicture

Container = Literal["mp4", "webm"]


class ParameterMismatchError(Exception):
    """The camera's parameter sets differ from the site's: its frames would be decoded wrongly."""


class StreamFormat:
    """H.264 or H.265 in MP4: the first keyframe of a site fixes the parameter sets of all its cameras."""

    container: Container = "mp4"

    def __init__(self, codec: NalCodec = H264) -> None:
        self.nal = codec
        self.parameters: ParameterSets | None = None

    @property
    def picture_codec(self) -> Codec:
        """The codec of the pictures."""
        return self.nal.name

    @property
    def codec(self) -> str | None:
        """The codec string of RFC 6381; None before the first keyframe."""
        return None if self.parameters is None else self.parameters.codec

    def adopt_or_check(self, parameters: ParameterSets | None) -> None:
        """Make a first keyframe's parameter sets the site's, or compare a later one's; None: it has none.

        Raises:
            ParameterMismatchError: they are missing, or not the site's.
        """
        if parameters is None:
            raise ParameterMismatchError("it sends a keyframe without parameter sets")
        if self.parameters is None:
            self.parameters = parameters
        elif parameters != self.parameters:
            raise ParameterMismatchError(
                f"its {self.nal.title} parameter sets differ from the other cameras'"
            )

    def accept(self, access_unit: bytes) -> ParameterSets | None:
        """Check a camera's keyframe; return its parameter sets, None where all cameras share theirs.

        Raises:
            ParameterMismatchError: it does not fit the site; the camera must be refused.
        """
        self.adopt_or_check(self.nal.parameter_sets(nal_units(access_unit)))
        return None

    def pack(self, access_unit: bytes, pulse: int, fps: float, *, key: bool) -> bytes:
        """Return a frame as a fragment, which can be spliced into any stream of the site."""
        return fragment([FragmentSample(self.nal.join_sample(nal_units(access_unit)), key)], pulse, fps)

    def init_segment(
        self,
        size: tuple[int, int],
        fps: float,
        audio: AudioFormat | None = None,
        *,
        pulses: int | None = None,
    ) -> bytes | None:
        """Return the initialization segment; None before the first keyframe.

        ``pulses`` is the length of a file, None for a live stream; the segment's size does not depend on it.
        """
        del fps, pulses  # players add up the fragments
        if self.parameters is None:
            return None
        return init_segment(self.parameters, *size, audio)

    def rebase(self, origin: int, fragment: bytes, fps: float) -> bytes:
        """Return a fragment shifted into a stream whose time 0 is the pulse ``origin``."""
        return shift_fragment(fragment, -ticks(origin, fps))

    def camera_parameters(self, fragment: bytes) -> ParameterSets | None:
        """Return a keyframe fragment's parameter sets; None where all cameras share theirs."""
        del fragment
        return None

    def gap_filler(self, newest: EncodedPicture, fps: float) -> GapFiller | None:
        """Return the gap filler after a picture; None if its parameter sets are not supported."""
        del newest
        return None if self.parameters is None else self._gap_filler(self.parameters, fps)

    def blank(
        self, newest: EncodedPicture | None, first: int, frames: int, fps: float
    ) -> list[EncodedPicture]:
        """Return a GOP of gray pictures to follow ``newest``; empty if its format is not supported.

        If a picture cannot be repeated in this format, one gray picture lasts for the whole GOP.
        """
        del newest
        return self._blank(self.parameters, None, first, frames, fps)

    def _blank(
        self,
        parameters: ParameterSets | None,
        attached: ParameterSets | None,
        first: int,
        frames: int,
        fps: float,
    ) -> list[EncodedPicture]:
        """Return a gray GOP in the format of ``parameters``; ``attached`` are set in its pictures."""
        if parameters is None:
            return []
        try:
            gray = self.nal.gray_picture(parameters, first // frames % 2)
        except UnsupportedParametersError:
            return []
        gap_filler = self._gap_filler(parameters, fps, attached)
        duration = frames if gap_filler is None else 1
        packed = fragment([FragmentSample(gray, key=True, duration=duration)], first, fps)
        key = EncodedPicture(
            first,
            key=True,
            fragment=packed,
            boot=NO_BOOT,
            duration=duration,
            parameters=attached,
            codec=self.picture_codec,
        )
        if gap_filler is None:
            return [key]
        return [
            key,
            *gap_filler.repeat_until_keyframe(
                key, [(pulse, 1) for pulse in range(first + 1, first + frames)]
            ),
        ]

    def _gap_filler(
        self, parameters: ParameterSets, fps: float, attached: ParameterSets | None = None
    ) -> GapFiller | None:
        """Return the gap filler for these parameter sets; None if they are not supported."""
        try:
            return self.nal.gap_filler(parameters, fps, attached)
        except UnsupportedParametersError:
            return None


class PerCameraStreamFormat(StreamFormat):
    """H.264 or H.265 in MP4 where parameter sets differ among cameras; keyframes carry them."""

    def accept(self, access_unit: bytes) -> ParameterSets:
        """Return the parameter sets of a camera's keyframe.

        Raises:
            ParameterMismatchError: it has none.
        """
        parameters = self.nal.parameter_sets(nal_units(access_unit))
        if parameters is None:
            raise ParameterMismatchError("it sends a keyframe without parameter sets")
        if self.parameters is None:
            self.parameters = replace(parameters, may_change=True)
        return parameters

    def camera_parameters(self, fragment: bytes) -> ParameterSets | None:
        """Return the parameter sets in a keyframe fragment, which always has them."""
        return self.nal.parameter_sets(split_sample(sample_of(fragment)))

    def gap_filler(self, newest: EncodedPicture, fps: float) -> GapFiller | None:
        """Return the gap filler after a picture, for its parameter sets."""
        if newest.parameters is None:
            return None
        return self._gap_filler(newest.parameters, fps, newest.parameters)

    def blank(
        self, newest: EncodedPicture | None, first: int, frames: int, fps: float
    ) -> list[EncodedPicture]:
        """Return a GOP of gray pictures with the parameter sets of a picture, which the first one carries."""
        parameters = self.parameters if newest is None or newest.parameters is None else newest.parameters
        return self._blank(parameters, parameters, first, frames, fps)
