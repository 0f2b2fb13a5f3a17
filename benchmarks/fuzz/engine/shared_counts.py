"""Counts of a target's inputs in shared memory, which outlives the feeding process."""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass

MAX_INPUT_BYTES = 1 << 20
"""Largest size of an input, bytes."""
_HEAD = struct.Struct("<6Q")


@dataclass(slots=True)
class InputCounts:
    """The counts of a target's inputs so far."""

    inputs: int = 0
    messages: int = 0
    """Messages in the inputs; an input that killed its process counts as one."""
    refused: int = 0
    accepted: int = 0
    crashes: int = 0


class SharedCounts:
    """Memory shared with child processes: the counts, and the current input."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, _HEAD.size + MAX_INPUT_BYTES)

    def store(self, counts: InputCounts, data: bytes = b"") -> None:
        """Store the counts before an input, and the input."""
        self._memory[_HEAD.size : _HEAD.size + len(data)] = data
        counters = (counts.inputs, counts.messages, counts.refused, counts.accepted, counts.crashes)
        _HEAD.pack_into(self._memory, 0, *counters, len(data))

    @property
    def counts(self) -> InputCounts:
        """Return the stored counts."""
        return InputCounts(*_HEAD.unpack_from(self._memory)[:-1])

    @property
    def data(self) -> bytes:
        """Return the stored input."""
        size = _HEAD.unpack_from(self._memory)[-1]
        return self._memory[_HEAD.size : _HEAD.size + size]
