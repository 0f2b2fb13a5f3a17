"""Fills gaps in H.265 streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.gap_filler import NO_BOOT, Span
from server.media.h265.repeat_picture import can_insert, repeat_after, repeat_between
from server.media.h265.slice_header import PictureOrder, read_picture_order
from server.media.h265.stream_syntax import StreamSyntax
from server.media.parameter_sets import ParameterSets
from server.media.picture import EncodedPicture


@dataclass(frozen=True, slots=True)
class H265GapFiller:
    """Repeats pictures by P pictures of skipped blocks (:mod:`server.media.h265.repeat_picture`)."""

    syntax: StreamSyntax
    fps: float
    parameters: ParameterSets | None = None
    """As in :class:`EncodedPicture`."""

    def can_read(self, picture: EncodedPicture) -> bool:
        """Return whether the picture has a picture order count, and refers to no later one."""
        try:
            order = self._order(picture)
        except ValueError:
            return False
        return all(reference.distance < 0 for reference in order.references)

    def repeat_until_keyframe(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Return repetitions whose order counts continue from the newest picture's."""
        first = self._order(newest).count
        return [
            self._picture(repeat_after(self.syntax, first + place), span) for place, span in enumerate(spans)
        ]

    def repeat_before(
        self, newest: EncodedPicture, picture: EncodedPicture, span: Span
    ) -> list[EncodedPicture]:
        """Return one picture between the newest and the given one."""
        return [self._picture(repeat_between(self.syntax, self._order(newest), self._order(picture)), span)]

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether nothing can be inserted, as a reference is missing or the order counts are adjacent.

        A camera that skipped pictures counts on, and so its GOP ends at the gap.
        """
        return missing > 0 and not can_insert(self.syntax, self._order(newest), self._order(picture))

    def _order(self, picture: EncodedPicture) -> PictureOrder:
        return read_picture_order(picture.sample, self.syntax)

    def _picture(self, data: bytes, span: Span) -> EncodedPicture:
        pulse, duration = span
        packed = fragment([FragmentSample(data, key=False, duration=duration)], pulse, self.fps)
        return EncodedPicture(
            pulse,
            key=False,
            fragment=packed,
            boot=NO_BOOT,
            duration=duration,
            parameters=self.parameters,
            codec="h265",
        )
