"""Incremental parser of WebM: elements, init segment, clusters and their time (RFC 9559; EBML: RFC 8794)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from client.media_stream import Fragment, InitSegment, MediaStreamError

TICKS = 1000
"""Ticks a second: the server's WebM counts in milliseconds."""
MAX_ELEMENT = 64_000_000  # bytes; a cluster of one picture has some thousand
_SEGMENT, _CLUSTER, _TIMESTAMP = 0x18538067, 0x1F43B675, 0xE7
_MAX_NUMBER = 8  # bytes


@dataclass(frozen=True, slots=True)
class Element:
    """An element: its id, all its bytes, and the length of its id and size."""

    id: int
    data: bytes
    header: int

    @property
    def content(self) -> bytes:
        """The bytes after its id and size."""
        return self.data[self.header :]


class ElementReader:
    """Splits a stream into elements; the segment, whose size is unknown, is only its header."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Element]:
        """Yield the elements that ``data`` completes.

        Raises:
            MediaStreamError: an element has an impossible id or size.
        """
        self._rest += data
        while (element := _element(self._rest, 0)) is not None:
            del self._rest[: len(element.data)]
            yield element


class WebmReader:
    """Splits the bytes of one connection into its init segment and its clusters."""

    def __init__(self) -> None:
        self._elements = ElementReader()
        self._pending = bytearray()  # elements before the next cluster
        self._has_init_segment = False

    def feed(self, data: bytes) -> Iterator[InitSegment | Fragment]:
        """Yield the parts that ``data`` completes.

        Raises:
            MediaStreamError: not a WebM with a time in each cluster.
        """
        for element in self._elements.feed(data):
            if element.id != _CLUSTER:
                self._pending += element.data
                if len(self._pending) > MAX_ELEMENT:
                    raise MediaStreamError("elements without pictures")
                continue
            if self._pending:
                yield InitSegment(bytes(self._pending), TICKS)
                self._pending.clear()
                self._has_init_segment = True
            if not self._has_init_segment:
                raise MediaStreamError("a cluster before the header")
            yield Fragment(element.data, cluster_time(element))


def cluster_time(cluster: Element) -> int:
    """Return a cluster's time in ticks.

    Raises:
        MediaStreamError: it has none.
    """
    at = cluster.header
    while (element := _element(cluster.data, at)) is not None:
        if element.id == _TIMESTAMP and len(element.content) <= _MAX_NUMBER:
            return int.from_bytes(element.content, "big")
        at += len(element.data)
    raise MediaStreamError("a cluster without a time")


def _element(data: bytes | bytearray, begin: int) -> Element | None:
    """Return the element at an offset; None if it is incomplete."""
    element_id, at = _number(data, begin, marked=True)
    size, end = _number(data, at, marked=False) if at else (0, 0)
    if not end:
        return None
    if element_id == _SEGMENT:
        return Element(element_id, bytes(data[begin:end]), end - begin)
    if size > MAX_ELEMENT:
        raise MediaStreamError(f"an element of {size} bytes")
    if end + size > len(data):
        return None
    return Element(element_id, bytes(data[begin : end + size]), end - begin)


def _number(data: bytes | bytearray, at: int, *, marked: bool) -> tuple[int, int]:
    """Return a number of variable length, with or without its length marker, and where it ends.

    Both are 0 if it is incomplete.
    """
    if at >= len(data):
        return 0, 0
    length = 9 - data[at].bit_length()
    if length > _MAX_NUMBER:
        raise MediaStreamError("not a number of EBML")
    if at + length > len(data):
        return 0, 0
    value = int.from_bytes(data[at : at + length], "big")
    return value if marked else value & (1 << 7 * length) - 1, at + length
