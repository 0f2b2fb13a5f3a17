"""What bridges a hole in a stream: pictures that show the one before them again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from server.media.containers.fmp4 import Sample, fragment
from server.media.h264.annexb import ParameterSets
from server.media.h264.repeat_picture import Continuing
from server.media.picture import Picture

Span = tuple[int, int]
"""A pulse, and for how many a picture is shown."""

NO_CAMERAS = -1
"""As a boot."""
_NUMBERS_TOLD = 15
"""Pictures that may be missing before frame_num, at least four bits of it, has come round."""


class Bridge(Protocol):
    """Makes such pictures; how depends on the codec."""

    def can_follow(self, picture: Picture) -> bool:
        """Return whether what this picture says of itself can be read, as all the other methods do."""

    def after(self, newest: Picture, spans: Sequence[Span]) -> list[Picture]:
        """Repeat the newest picture; only a key picture can follow."""

    def before(self, picture: Picture, span: Span) -> list[Picture]:
        """Repeat what is before a picture that was not taken, so that this one can be decoded after it."""

    def is_lost_between(self, newest: Picture, picture: Picture, missing: int) -> bool:
        """Return whether of the missing ones something was encoded that the picture is decoded by.

        Both are of one GOP of one run of a camera.
        """


@dataclass(frozen=True, slots=True)
class H264Bridge:
    """Pictures in which every macroblock is skipped (:mod:`server.media.h264.repeat_picture`)."""

    how: Continuing
    fps: float
    parameters: ParameterSets | None = None
    """As of :class:`Picture`."""

    def can_follow(self, picture: Picture) -> bool:
        """Return whether it has a number."""
        try:
            self.how.frame_num(picture.sample)
        except ValueError:
            return False
        return True

    def after(self, newest: Picture, spans: Sequence[Span]) -> list[Picture]:
        """Count on from the newest picture."""
        number, made = self.how.frame_num(newest.sample), []
        for span in spans:
            number = self.how.next_num(number)
            made.append(self._made(self.how.repeat(number, reference=True), span))
        return made

    def before(self, picture: Picture, span: Span) -> list[Picture]:
        """Return one picture with the number of the next, so it is no reference, and only one."""
        return [self._made(self.how.repeat(self.how.frame_num(picture.sample), reference=False), span)]

    def is_lost_between(self, newest: Picture, picture: Picture, missing: int) -> bool:
        """Tell it by the numbers, which count what was encoded."""
        if missing == 0 or missing >= _NUMBERS_TOLD:
            return missing > 0
        return self.how.frame_num(picture.sample) != self.how.next_num(self.how.frame_num(newest.sample))

    def _made(self, data: bytes, span: Span) -> Picture:
        pulse, lasts = span
        made = fragment([Sample(data, key=False, lasts=lasts)], pulse, self.fps)
        return Picture(
            pulse, key=False, fragment=made, boot=NO_CAMERAS, lasts=lasts, parameters=self.parameters
        )
