"""What the trackers of the survey differ in: how they know where somebody is in the next picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

from tracking.boxes import Floats
from tracking.detectors.base import Image

S = TypeVar("S")
"""What a method remembers of one object."""


class Method(Protocol, Generic[S]):
    """One way of following objects from picture to picture. Deterministic: no clock, a seed of its own."""

    name: str
    sees: bool
    """It looks at the picture: where it says that somebody is counts without a detection there, too."""

    def begin(self, image: Image, box: Floats) -> S:
        """Take somebody new in, who is in this `(4,)` box. Who does not look is not given the picture."""
        ...

    def move(self, image: Image | None, objects: Sequence[S]) -> Floats:
        """Say where all of them are in the next picture: `(N, 4)`, NaN for those who are lost."""
        ...

    def found(self, known: S, box: Floats) -> Floats:
        """Hear of the detection `(4,)` that somebody was matched with; give where they are then, `(4,)`."""
        ...
