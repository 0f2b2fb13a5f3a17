"""Pictures of a stream in a row, packed once however many watch them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from server.view.fmp4 import sample_of


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture, ready as an MP4 fragment."""

    pulse: int
    key: bool
    fragment: bytes
    boot: int
    """Which run of the camera's process it is from; pictures of two runs do not build on each other."""
    lasts: int = 1
    """Pulses that it is shown for."""

    @property
    def until(self) -> int:
        """The first pulse after it."""
        return self.pulse + self.lasts

    @property
    def sample(self) -> bytes:
        """Its NAL units, each behind its length."""
        return sample_of(self.fragment)


class Footage:
    """Consecutive pictures as a piece of a stream (:class:`server.view.channel.Piece`).

    Each form is made when it is first asked for, and then shared by all who are given this piece.
    """

    def __init__(self, pictures: Sequence[Picture], *, fills: bool = False) -> None:
        self.pictures = tuple(pictures)
        self.start = self.pictures[0].key
        self.fills = fills

    @property
    def first(self) -> int:
        """The first pulse."""
        return self.pictures[0].pulse

    @property
    def until(self) -> int:
        """The first pulse after it."""
        return self.pictures[-1].until

    @cached_property
    def data(self) -> bytes:
        """The pictures as fragments of MP4."""
        return b"".join(picture.fragment for picture in self.pictures)
