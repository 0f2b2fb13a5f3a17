"""Fills gaps in H.264 streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.gap_filler import NO_BOOT, Span
from server.media.h264.repeat_picture import SliceHeaderFormat
from server.media.parameter_sets import ParameterSets
from server.media.picture import EncodedPicture

_MAX_COUNTED_LOSS = 15
"""Missing pictures that frame_num, which has at least four bits, counts without wrapping around."""


@dataclass(frozen=True, slots=True)
class H264GapFiller:
    """Repeats pictures by P pictures of skipped macroblocks (:mod:`server.media.h264.repeat_picture`)."""

    header_format: SliceHeaderFormat
    fps: float
    parameters: ParameterSets | None = None
    """As in :class:`EncodedPicture`."""

    def can_read(self, picture: EncodedPicture) -> bool:
        """Return whether the picture has a frame_num."""
        try:
            self.header_format.frame_num(picture.sample)
        except ValueError:
            return False
        return True

    def repeat_until_keyframe(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Return repetitions whose frame_num counts on from the newest picture's."""
        number, pictures = self.header_format.frame_num(newest.sample), []
        for span in spans:
            number = self.header_format.next_num(number)
            pictures.append(self._picture(self.header_format.repeat(number, reference=True), span))
        return pictures

    def repeat_before(
        self, newest: EncodedPicture, picture: EncodedPicture, span: Span
    ) -> list[EncodedPicture]:
        """Return one non-reference picture with the frame_num of the given picture."""
        del newest
        number = self.header_format.frame_num(picture.sample)
        return [self._picture(self.header_format.repeat(number, reference=False), span)]

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether pictures were lost between two, by frame_num, which counts encoded pictures."""
        if missing == 0 or missing >= _MAX_COUNTED_LOSS:
            return missing > 0
        number = self.header_format.frame_num(picture.sample)
        return number != self.header_format.next_num(self.header_format.frame_num(newest.sample))

    def _picture(self, data: bytes, span: Span) -> EncodedPicture:
        pulse, duration = span
        packed = fragment([FragmentSample(data, key=False, duration=duration)], pulse, self.fps)
        return EncodedPicture(
            pulse, key=False, fragment=packed, boot=NO_BOOT, duration=duration, parameters=self.parameters
        )
