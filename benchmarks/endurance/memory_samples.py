"""Memory samples of this process over a long run, and their growth."""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SPAN = 10_000
"""Frames per which growth is measured."""
_MEGABYTE = 1e6
_STATM = Path("/proc/self/statm")
_RESIDENT = 1
"""Field of the resident pages (proc(5))."""


def resident_megabytes() -> float:
    """Return the resident memory of this process, megabytes (Linux)."""
    pages = int(_STATM.read_text(encoding="ascii").split()[_RESIDENT])
    return pages * os.sysconf("SC_PAGE_SIZE") / _MEGABYTE


@dataclass(slots=True)
class MemorySamples:
    """Memory and processor time after some numbers of frames."""

    frames: list[int] = field(default_factory=list)
    megabytes: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    """Processor time since the start."""
    blocks: list[int] = field(default_factory=list)
    """Python memory blocks in use, which distinguish a leak from heap fragmentation."""

    def add(self, frames: int) -> None:
        """Add a sample, after clearing Python's free lists, which fill slowly."""
        gc.collect()
        self.frames.append(frames)
        self.megabytes.append(resident_megabytes())
        self.seconds.append(time.process_time())
        self.blocks.append(sys.getallocatedblocks())

    def between(self, start: int, stop: int) -> MemorySamples:
        """Return the samples after `start` frames and up to `stop`."""
        kept = [index for index, frames in enumerate(self.frames) if start < frames <= stop]
        return MemorySamples(
            [self.frames[index] for index in kept],
            [self.megabytes[index] for index in kept],
            [self.seconds[index] for index in kept],
            [self.blocks[index] for index in kept],
        )

    def milliseconds_per_frame(self) -> float:
        """Return the processor time per frame between the first and the last sample."""
        return 1e3 * (self.seconds[-1] - self.seconds[0]) / (self.frames[-1] - self.frames[0])

    def growth(self) -> float:
        """Return the growth per :data:`SPAN` frames, megabytes, by linear regression."""
        return self._per_span(self.megabytes)

    def block_growth(self) -> float:
        """Return the growth of memory blocks per :data:`SPAN` frames, by linear regression."""
        return self._per_span(self.blocks)

    def _per_span(self, values: Sequence[float]) -> float:
        return float(SPAN * np.polyfit(self.frames, values, 1)[0])
