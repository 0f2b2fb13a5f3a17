"""WebM as it arrives: whole top-level elements, and the time of a cluster (RFC 9559, in EBML, RFC 8794)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

TICKS = 1000
"""Ticks a second: the server's WebM counts in milliseconds."""

EBML, SEGMENT, INFO, TRACKS, CLUSTER = 0x1A45DFA3, 0x18538067, 0x1549A966, 0x1654AE6B, 0x1F43B675
_TIMESTAMP, _SIMPLE_BLOCK = 0xE7, 0xA3
_KEY = 0x80
LARGEST = 64_000_000  # bytes; a cluster of one picture has some thousand
_LONGEST_NUMBER = 8


class WebmError(ValueError):
    """The bytes are not such a WebM."""


@dataclass(frozen=True, slots=True)
class Element:
    """An element: its name, all its bytes, and where in them its content begins."""

    name: int
    data: bytes
    head: int

    @property
    def content(self) -> bytes:
        """The bytes after its name and size."""
        return self.data[self.head :]


class ElementReader:
    """Cuts a stream into its elements; of the segment, which has no end, only the head is one."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Element]:
        """Yield the elements that ``data`` completes.

        Raises:
            WebmError: a name or a size that no element can have.
        """
        self._rest += data
        while (element := _element(self._rest, 0)) is not None:
            del self._rest[: len(element.data)]
            yield element


def cluster_time(cluster: Element) -> int:
    """Return a cluster's time in ticks.

    Raises:
        WebmError: it does not say.
    """
    for element in _inside(cluster):
        if element.name == _TIMESTAMP and len(element.content) <= _LONGEST_NUMBER:
            return int.from_bytes(element.content, "big")
    raise WebmError("a cluster without a time")


def is_key(cluster: Element) -> bool:
    """Return whether a cluster begins with a key frame."""
    for element in _inside(cluster):
        if element.name == _SIMPLE_BLOCK:
            content = element.content
            return len(content) > 3 and bool(content[3] & _KEY)  # noqa: PLR2004 — track, time, flags
    return False


def at_time(cluster: Element, ticks: int) -> bytes:
    """Return the cluster at another time, as many bytes as before.

    Raises:
        WebmError: it has no room for that time: its own is no longer, or there are several.
    """
    parts = []
    for element in _inside(cluster):
        if element.name == _TIMESTAMP:
            if ticks.bit_length() > 8 * len(element.content):
                raise WebmError("a cluster without room for its time")
            parts.append(element.data[: element.head] + ticks.to_bytes(len(element.content), "big"))
        else:
            parts.append(element.data)
    return cluster.data[: cluster.head] + b"".join(parts)


def made(name: int, content: bytes) -> bytes:
    """Return an element."""
    return _name(name) + _size(len(content)) + content


def number(name: int, value: int, length: int = 8) -> bytes:
    """Return an element that holds a number."""
    return made(name, value.to_bytes(length, "big"))


def _name(name: int) -> bytes:
    return name.to_bytes((name.bit_length() + 7) // 8, "big")


def _size(size: int) -> bytes:
    return (size | 1 << 56).to_bytes(_LONGEST_NUMBER, "big")


def _inside(element: Element) -> Iterator[Element]:
    """Yield the elements inside another."""
    at = element.head
    while (inner := _element(element.data, at)) is not None:
        at += len(inner.data)
        yield inner


def _element(data: bytes | bytearray, begin: int) -> Element | None:
    """Return the element that begins there; None if it is not whole yet."""
    name, at = _number(data, begin, marked=True)
    size, end = _number(data, at, marked=False) if at else (0, 0)
    if not end:
        return None
    if name == SEGMENT:
        return Element(name, bytes(data[begin:end]), end - begin)
    if size > LARGEST:
        raise WebmError(f"an element of {size} bytes")
    return None if end + size > len(data) else Element(name, bytes(data[begin : end + size]), end - begin)


def _number(data: bytes | bytearray, at: int, *, marked: bool) -> tuple[int, int]:
    """Return a number whose first bits say how long it is, and where it ends; 0 where it is not whole."""
    if at >= len(data):
        return 0, 0
    length = 9 - data[at].bit_length()
    if length > _LONGEST_NUMBER:
        raise WebmError("not a number of EBML")
    if at + length > len(data):
        return 0, 0
    value = int.from_bytes(data[at : at + length], "big")
    return value if marked else value & (1 << 7 * length) - 1, at + length
