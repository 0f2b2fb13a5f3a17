"""The interface of picture sources."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""``(height, width, 3)`` BGR."""


class SourceEndedError(Exception):
    """The recording has no picture for this pulse or any later one."""


class PictureSource(Protocol):
    """Returns the picture of a pulse. Used from one thread at a time; ``take`` may block."""

    size: tuple[int, int]
    """Width and height of its pictures in pixels."""
    recorded: bool
    """Whether it is a recording: a pulse's picture is the same whenever it is taken."""

    def take(self, pulse: int) -> Image | None:
        """Return the picture of a pulse; None: there is none (yet). Pulses must ascend.

        Raises:
            SourceEndedError: the recording is over.
        """
        ...

    def ahead(self, places: Sequence[int]) -> Iterator[Image]:
        """Return a recording's pictures at ascending positions, without moving the playback position.

        Fewer where the recording is shorter; none for a live source.
        """
        ...

    def close(self) -> None:
        """Close files, devices and connections."""
        ...
