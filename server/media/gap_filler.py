"""What bridges a hole in a stream: pictures that show the one before them again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.h264.annexb import ParameterSets
from server.media.h264.repeat_picture import SliceHeadFormat
from server.media.picture import EncodedPicture

Span = tuple[int, int]
"""A pulse, and for how many a picture is shown."""

NO_CAMERAS = -1
"""As a boot."""
_NUMBERS_TOLD = 15
"""Pictures that may be missing before frame_num, at least four bits of it, has come round."""


class GapFiller(Protocol):
    """Makes pictures that repeat the last one; how depends on the codec."""

    def can_follow(self, picture: EncodedPicture) -> bool:
        """Return whether what this picture says of itself can be read, as all the other methods do."""

    def after(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Repeat the newest picture; only a key picture can follow."""

    def before(self, picture: EncodedPicture, span: Span) -> list[EncodedPicture]:
        """Repeat what is before a picture that was not taken, so that this one can be decoded after it."""

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether of the missing ones something was encoded that the picture is decoded by.

        Both are of one GOP of one run of a camera.
        """


@dataclass(frozen=True, slots=True)
class H264GapFiller:
    """Pictures in which every macroblock is skipped (:mod:`server.media.h264.repeat_picture`)."""

    how: SliceHeadFormat
    fps: float
    parameters: ParameterSets | None = None
    """As of :class:`EncodedPicture`."""

    def can_follow(self, picture: EncodedPicture) -> bool:
        """Return whether it has a number."""
        try:
            self.how.frame_num(picture.sample)
        except ValueError:
            return False
        return True

    def after(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Count on from the newest picture."""
        number, made = self.how.frame_num(newest.sample), []
        for span in spans:
            number = self.how.next_num(number)
            made.append(self._made(self.how.repeat(number, reference=True), span))
        return made

    def before(self, picture: EncodedPicture, span: Span) -> list[EncodedPicture]:
        """Return one picture with the number of the next, so it is no reference, and only one."""
        return [self._made(self.how.repeat(self.how.frame_num(picture.sample), reference=False), span)]

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether pictures were lost between two, by ``frame_num``, which counts encoded pictures."""
        if missing == 0 or missing >= _NUMBERS_TOLD:
            return missing > 0
        return self.how.frame_num(picture.sample) != self.how.next_num(self.how.frame_num(newest.sample))

    def _made(self, data: bytes, span: Span) -> EncodedPicture:
        pulse, lasts = span
        made = fragment([FragmentSample(data, key=False, lasts=lasts)], pulse, self.fps)
        return EncodedPicture(
            pulse, key=False, fragment=made, boot=NO_CAMERAS, lasts=lasts, parameters=self.parameters
        )
