"""What all streams of a site are made of, which its cameras must share."""

from __future__ import annotations

from typing import Literal

from server.view.bridge import Bridge, H264Bridge
from server.view.fmp4 import Sample, fragment, init_segment, rebased, ticks
from server.view.skip import UnfitError, continuing
from server.wire.h264 import ParameterSets, nal_units, parameter_sets, sample
from server.wire.sections import Site
from server.wire.sound import SoundFormat

Container = Literal["mp4", "webm"]


class ParameterMismatchError(Exception):
    """The camera's parameters are not the site's: its frames would decode into wrong pixels."""


class Agreement:
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

    def pack(self, access_unit: bytes, pulse: int, fps: float, *, key: bool) -> bytes:
        """Give a frame as a fragment, which fits into any stream of the site.

        Raises:
            ParameterMismatchError: its parameter sets are not the site's, and the camera must be refused.
        """
        units = nal_units(access_unit)
        if key:
            self.check(parameter_sets(units))
        return fragment([Sample(sample(units), key)], pulse, fps)

    def head(
        self, site: Site, sound: SoundFormat | None = None, *, pulses: int | None = None
    ) -> bytes | None:
        """Give what a player needs before the first fragment; None before the first key frame.

        ``pulses``: how many there are in a file. Its size does not depend on the number.
        """
        del pulses  # players add up the fragments
        if self.parameters is None:
            return None
        return init_segment(self.parameters, site.width, site.height, sound)

    def begun_at(self, origin: int, fragment: bytes, fps: float) -> bytes:
        """Give a fragment as it is in a stream that has this pulse at time 0."""
        return rebased(fragment, -ticks(origin, fps))

    def bridge(self, fps: float) -> Bridge | None:
        """Give what bridges holes; None where it is not known how."""
        if self.parameters is None:
            return None
        try:
            return H264Bridge(continuing(self.parameters), fps)
        except UnfitError:
            return None
