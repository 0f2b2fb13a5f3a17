"""Reads and writes bits of H.264 and H.265 syntax (ITU-T H.264, 7.2, 7.4.1 and 9.1; ITU-T H.265 likewise)."""

from __future__ import annotations

import re

_ESCAPED = re.compile(b"\x00\x00\x03")
_TO_ESCAPE = re.compile(b"\x00\x00(?=[\x00-\x03])")


def unescape_payload(unit: bytes, head_bytes: int = 1) -> bytes:
    """Return a NAL unit's payload, without its header of ``head_bytes`` and emulation prevention bytes."""
    return _ESCAPED.sub(b"\x00\x00", unit[head_bytes:])


def escape_payload(head: bytes, payload: bytes) -> bytes:
    """Return the NAL unit of a header and a payload, with emulation prevention bytes."""
    return head + _TO_ESCAPE.sub(b"\x00\x00\x03", payload)


class BitReader:
    """Reads a payload bit by bit.

    Raises:
        ValueError: in every method, at the end of the bits.
    """

    def __init__(self, payload: bytes) -> None:
        self._bits = "".join(f"{byte:08b}" for byte in payload)
        self._at = 0

    def u(self, count: int) -> int:
        """Read an unsigned number of ``count`` bits."""
        bits = self._bits[self._at : self._at + count]
        if len(bits) < count:
            raise ValueError("no bits are left")
        self._at += count
        return int(bits, 2) if count else 0

    def ue(self) -> int:
        """Read an unsigned Exp-Golomb number."""
        one = self._bits.find("1", self._at)
        if one < 0:
            raise ValueError("no bits are left")
        zeros = one - self._at
        self._at = one
        return self.u(zeros + 1) - 1

    def se(self) -> int:
        """Read a signed Exp-Golomb number."""
        code = self.ue()
        return (code + 1) // 2 if code % 2 else -(code // 2)


class BitWriter:
    """Writes a payload bit by bit."""

    def __init__(self) -> None:
        self._bits: list[str] = []
        self._count = 0

    def u(self, count: int, value: int) -> None:
        """Write an unsigned number in ``count`` bits."""
        self._bits.append(f"{value:0{count}b}")
        self._count += count

    def copy(self, text: str) -> None:
        """Write bits given as text of zeros and ones."""
        self._bits.append(text)
        self._count += len(text)

    @property
    def text(self) -> str:
        """The bits so far, as text of zeros and ones."""
        return "".join(self._bits)

    def ue(self, value: int) -> None:
        """Write an unsigned Exp-Golomb number."""
        self.u(2 * (value + 1).bit_length() - 1, value + 1)

    def se(self, value: int) -> None:
        """Write a signed Exp-Golomb number."""
        self.ue(2 * value - 1 if value > 0 else -2 * value)

    def align(self, bit: int) -> None:
        """Fill the last byte with ones or zeros."""
        while self._count % 8:
            self.u(1, bit)

    def to_bytes(self) -> bytes:
        """Return the bytes; call :meth:`align` before."""
        bits = self.text
        return bytes(int(bits[at : at + 8], 2) for at in range(0, len(bits), 8))
