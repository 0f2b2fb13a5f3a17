"""One GOP of a segment of HLS, which players that know parts fetch before the segment is whole."""

from __future__ import annotations

from dataclasses import dataclass

from server.media.containers.fmp4 import Sample, still
from server.service.streaming.media_chunk import Footage


@dataclass(frozen=True)
class Part:
    """One GOP of a segment. ``lead`` is what stands if nothing has been shown in the segment yet."""

    segment: int
    footage: Footage
    lead: Footage | None
    fps: float

    @property
    def independent(self) -> bool:
        """Whether it can be decoded without the parts before."""
        return self.footage.start or self.lead is not None

    @property
    def data(self) -> bytes:
        """The part as fragments of MP4."""
        shown = self.footage
        if self.lead is None:
            return shown.with_sound
        return shown.sound + standing_for(self.lead, shown.first, shown.until, self.fps)


def standing_for(lead: Footage, first: int, until: int, fps: float) -> bytes:
    """Show the lead's last picture for some pulses: what it is decoded by passes within a few ticks."""
    samples = [Sample(picture.sample, picture.key) for picture in lead.pictures]
    return still(samples, first, until, fps)
