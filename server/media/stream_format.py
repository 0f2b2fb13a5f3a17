"""What all streams of a site are made of, which its cameras must share."""

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
from server.media.gap_filler import NO_CAMERAS, GapFiller, H264GapFiller
from server.media.h264.annexb import ParameterSets, join_sample, nal_units, parameter_sets, split_sample
from server.media.h264.grey_picture import grey_picture
from server.media.h264.repeat_picture import UnsupportedParametersError, parse_repeatable
from server.media.picture import EncodedPicture

Container = Literal["mp4", "webm"]


class ParameterMismatchError(Exception):
    """The camera's parameters are not the site's: its frames would decode into wrong pixels."""


class StreamFormat:
    """H.264 in MP4: the first key frame of a site fixes the parameter sets.

    Whoever has others cannot be spliced in.
    """

    container: Container = "mp4"

    def __init__(self) -> None:
        self.parameters: ParameterSets | None = None

    @property
    def codec(self) -> str | None:
        """The codec string of RFC 6381; None before the first key frame."""
        return None if self.parameters is None else self.parameters.codec

    def check(self, found: ParameterSets | None) -> None:
        """Compare the parameter sets of a key frame, None where it has none.

        Raises:
            ParameterMismatchError: they are missing, or not the site's.
        """
        if found is None:
            raise ParameterMismatchError("a key frame without parameter sets")
        if self.parameters is None:
            self.parameters = found
        elif found != self.parameters:
            raise ParameterMismatchError("its H.264 parameter sets differ from the other cameras'")

    def accept(self, key: bytes) -> ParameterSets | None:
        """Look at a camera's key frame; give the parameter sets up to the next, where they are its own.

        Raises:
            ParameterMismatchError: it is not of the site, and the camera must be refused.
        """
        self.check(parameter_sets(nal_units(key)))
        return None

    def pack(self, access_unit: bytes, pulse: int, fps: float, *, key: bool) -> bytes:
        """Return a frame as a fragment, which fits into any stream of the site."""
        return fragment([FragmentSample(join_sample(nal_units(access_unit)), key)], pulse, fps)

    def head(
        self,
        size: tuple[int, int],
        fps: float,
        sound: AudioFormat | None = None,
        *,
        pulses: int | None = None,
    ) -> bytes | None:
        """Return what a player needs before the first fragment; None before the first key frame.

        ``pulses``: how many there are in a file. Its size does not depend on the number.
        """
        del fps, pulses  # players add up the fragments
        if self.parameters is None:
            return None
        return init_segment(self.parameters, *size, sound)

    def begun_at(self, origin: int, fragment: bytes, fps: float) -> bytes:
        """Return a fragment as it is in a stream that has this pulse at time 0."""
        return shift_fragment(fragment, -ticks(origin, fps))

    def told_by(self, key: bytes) -> ParameterSets | None:
        """Return the parameter sets of the pictures from a key fragment on, where they may be its own."""
        del key
        return None

    def bridge(self, newest: EncodedPicture, fps: float) -> GapFiller | None:
        """Return what bridges holes after a picture; None where it is not known how."""
        del newest
        return None if self.parameters is None else gap_filler_for(self.parameters, fps)

    def blank(
        self, newest: EncodedPicture | None, first: int, frames: int, fps: float
    ) -> list[EncodedPicture]:
        """Return a GOP of grey pictures that fits after a picture; nothing where it is not known how.

        Where its last picture cannot be repeated, the grey one lasts for all of it.
        """
        del newest
        return self._blank(self.parameters, None, first, frames, fps)

    def _blank(
        self,
        written_by: ParameterSets | None,
        decoded_by: ParameterSets | None,
        first: int,
        frames: int,
        fps: float,
    ) -> list[EncodedPicture]:
        """Return that GOP by some parameter sets; ``decoded_by`` is what its pictures say of themselves."""
        if written_by is None:
            return []
        try:
            grey = grey_picture(written_by, first // frames % 2)
        except UnsupportedParametersError:
            return []
        bridge = gap_filler_for(written_by, fps)
        lasts = frames if bridge is None else 1
        made = fragment([FragmentSample(grey, key=True, lasts=lasts)], first, fps)
        key = EncodedPicture(
            first, key=True, fragment=made, boot=NO_CAMERAS, lasts=lasts, parameters=decoded_by
        )
        if bridge is None:
            return [key]
        bridge = replace(bridge, parameters=decoded_by)
        return [key, *bridge.after(key, [(pulse, 1) for pulse in range(first + 1, first + frames)])]


class PerCameraStreamFormat(StreamFormat):
    """H.264 in MP4 where each camera has parameter sets of its own, carried by its key frames."""

    def accept(self, key: bytes) -> ParameterSets:
        """Take a camera's parameter sets for its own.

        Raises:
            ParameterMismatchError: it has none.
        """
        found = parameter_sets(nal_units(key))
        if found is None:
            raise ParameterMismatchError("a key frame without parameter sets")
        if self.parameters is None:
            self.parameters = replace(found, may_change=True)
        return found

    def told_by(self, key: bytes) -> ParameterSets | None:
        """Find them in the picture, where they always are."""
        return parameter_sets(split_sample(sample_of(key)))

    def bridge(self, newest: EncodedPicture, fps: float) -> GapFiller | None:
        """Return what bridges holes after a picture, by that picture's own parameter sets."""
        if newest.parameters is None:
            return None
        bridge = gap_filler_for(newest.parameters, fps)
        return None if bridge is None else replace(bridge, parameters=newest.parameters)

    def blank(
        self, newest: EncodedPicture | None, first: int, frames: int, fps: float
    ) -> list[EncodedPicture]:
        """Return a GOP of grey pictures by the parameter sets of a picture; they are in it, as at any cut."""
        known = self.parameters if newest is None or newest.parameters is None else newest.parameters
        return self._blank(known, known, first, frames, fps)


def gap_filler_for(parameters: ParameterSets, fps: float) -> H264GapFiller | None:
    """Return the gap filler for a stream of these parameter sets; None where there is none."""
    try:
        return H264GapFiller(parse_repeatable(parameters), fps)
    except UnsupportedParametersError:
        return None
