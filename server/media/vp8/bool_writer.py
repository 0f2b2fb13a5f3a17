"""Writes the entropy-coded bits of VP8."""

from __future__ import annotations

_PADDING_BITS = 32


class BoolWriter:
    """The boolean entropy encoder (RFC 6386, 7.3), on integers of any length."""

    def __init__(self) -> None:
        self._bottom, self._range, self._bits = 0, 255, 0

    def put(self, bit: int, probability: int) -> None:
        """Write a bit; ``probability``, out of 256, is that of 0."""
        split = 1 + ((self._range - 1) * probability >> 8)
        if bit:
            self._bottom += split
            self._range -= split
        else:
            self._range = split
        shift = 8 - self._range.bit_length()
        self._range <<= shift
        self._bottom <<= shift
        self._bits += shift

    def number(self, bits: int, value: int) -> None:
        """Write an unsigned number in ``bits`` bits, the highest first."""
        for place in reversed(range(bits)):
            self.put(value >> place & 1, 128)

    def to_bytes(self) -> bytes:
        """Return the bytes, padded: decoders read ahead, and some take the end of the data for damage."""
        self.number(_PADDING_BITS, 0)
        bits = self._bits + 8
        spare = -bits % 8
        return (self._bottom << spare).to_bytes((bits + spare) // 8, "big")
