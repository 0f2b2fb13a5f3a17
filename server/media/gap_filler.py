"""Fills a gap in a stream by repeating the picture before it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from server.media.picture import EncodedPicture

Span = tuple[int, int]
"""The pulse of a picture, and the number of pulses it is shown for."""

NO_BOOT = -1
"""The boot of a picture that the service has written itself."""


class GapFiller(Protocol):
    """Writes pictures that repeat the last one, in the stream's codec."""

    def can_read(self, picture: EncodedPicture) -> bool:
        """Return whether the other methods can read this picture."""

    def repeat_until_keyframe(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Return repetitions of the newest picture; only a keyframe can be decoded after them."""

    def repeat_before(
        self, newest: EncodedPicture, picture: EncodedPicture, span: Span
    ) -> list[EncodedPicture]:
        """Return a repetition of the newest picture; the given picture can still be decoded after it."""

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether a reference of the picture is among the ``missing`` pulses after the newest one.

        Both pictures are in one GOP of one run of a camera.
        """
