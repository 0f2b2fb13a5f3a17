"""What every source of pictures can do."""

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
    """A recording waits for nobody: its picture of a pulse is the same whenever it is asked for."""

    def take(self, pulse: int) -> Image | None:
        """Return the picture of a pulse; pulses must grow. None: there is none (yet).

        Raises:
            SourceEndedError: the recording is over.
        """
        ...

    def ahead(self, places: Sequence[int]) -> Iterator[Image]:
        """Return the pictures at some places of a recording, counted from its beginning, by rising place.

        What is played stays where it is. Fewer where the recording is shorter; none of what is no recording.
        """
        ...

    def close(self) -> None:
        """Let go of files, devices and connections."""
        ...
