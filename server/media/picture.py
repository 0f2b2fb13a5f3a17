"""An encoded picture of a stream, packed for its container."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from server.media.containers.fmp4 import sample_of
from server.media.parameter_sets import ParameterSets

Codec = Literal["h264", "h265", "vp8"]
"""The codecs of a site's streams."""


@dataclass(frozen=True, slots=True)
class EncodedPicture:
    """One encoded picture, packed for the stream's container."""

    pulse: int
    key: bool
    fragment: bytes
    """An MP4 fragment, or a WebM cluster."""
    boot: int
    """The run of the camera's process; a picture never references one of another run."""
    duration: int = 1
    """The number of pulses it is shown for."""
    reference_pulse: int | None = None
    """The pulse of its reference picture; None: unknown, or it has none."""
    parameters: ParameterSets | None = None
    """Its parameter sets; None where all cameras of the site share theirs."""
    codec: Codec = "h264"

    @property
    def until(self) -> int:
        """The first pulse after it."""
        return self.pulse + self.duration

    @property
    def sample(self) -> bytes:
        """Its length-prefixed NAL units, if the fragment is MP4."""
        return sample_of(self.fragment)
