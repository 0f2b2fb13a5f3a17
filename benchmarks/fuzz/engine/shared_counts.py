"""What came of a target's inputs, kept where it outlives the process that feeds them."""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass

ROOM = 1 << 20
"""Bytes of an input."""
_HEAD = struct.Struct("<6Q")


@dataclass(slots=True)
class InputCounts:
    """What came of a target's inputs so far."""

    inputs: int = 0
    messages: int = 0
    """That they were made of. Of an input that a process died of one is counted: nobody knows how many."""
    refused: int = 0
    accepted: int = 0
    crashes: int = 0


class SharedCounts:
    """Memory that a process and its children have in common: counts, and the input that is being fed."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, _HEAD.size + ROOM)

    def keep(self, counts: InputCounts, data: bytes = b"") -> None:
        """Keep what has come of the inputs before this one."""
        self._memory[_HEAD.size : _HEAD.size + len(data)] = data
        told = (counts.inputs, counts.messages, counts.refused, counts.accepted, counts.crashes)
        _HEAD.pack_into(self._memory, 0, *told, len(data))

    @property
    def counts(self) -> InputCounts:
        """Return what was kept last."""
        return InputCounts(*_HEAD.unpack_from(self._memory)[:-1])

    @property
    def data(self) -> bytes:
        """Return the input that was kept last."""
        size = _HEAD.unpack_from(self._memory)[-1]
        return self._memory[_HEAD.size : _HEAD.size + size]
