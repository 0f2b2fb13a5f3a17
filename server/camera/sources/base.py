"""The interface of frame sources."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""``(height, width, 3)`` BGR."""


class SourceEndedError(Exception):
    """The recording has no frame for this pulse or any later one."""


class FrameSource(Protocol):
    """Returns the image of a pulse. Used from one thread at a time; ``take`` may block."""

    size: tuple[int, int]
    """Width and height of its images in pixels."""
    recorded: bool
    """Whether it is a recording: the image of a pulse is always the same."""

    def take(self, pulse: int) -> Image | None:
        """Return the image of a pulse; None: there is none (yet). Pulses must ascend.

        Raises:
            SourceEndedError: the recording is over.
        """
        ...

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Return a recording's frames with these ascending indices; the playback position stays.

        Fewer where the recording is shorter; none for a live source.
        """
        ...

    def close(self) -> None:
        """Close files, devices and connections."""
        ...
