"""One picture of a stream."""

from __future__ import annotations

from dataclasses import dataclass

from server.media.containers.fmp4 import sample_of
from server.media.h264.annexb import ParameterSets


@dataclass(frozen=True, slots=True)
class EncodedPicture:
    """One encoded picture, ready to be sent."""

    pulse: int
    key: bool
    fragment: bytes
    """Of MP4, or a cluster of WebM."""
    boot: int
    """Which run of the camera's process it is from; pictures of two runs do not build on each other."""
    lasts: int = 1
    """Pulses that it is shown for."""
    after: int | None = None
    """The pulse of the one that it is decoded by; None: it is not known, or none."""
    parameters: ParameterSets | None = None
    """Those that it is decoded by, if they are not the same in all streams of the site."""

    @property
    def until(self) -> int:
        """The first pulse after it."""
        return self.pulse + self.lasts

    @property
    def sample(self) -> bytes:
        """Its NAL units, each behind its length; of a fragment of MP4."""
        return sample_of(self.fragment)
