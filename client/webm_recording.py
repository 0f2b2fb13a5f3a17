"""A WebM stream on its way into a file: whole pictures only, from time 0, with an index at the end."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from client.atomic_writer import Sink
from client.webm import (
    CLUSTER,
    INFO,
    LARGEST,
    SEGMENT,
    TICKS,
    Element,
    ElementReader,
    WebmError,
    at_time,
    cluster_time,
    is_key,
    made,
    number,
)

_DURATION = 0x4489
_CUES, _CUE_POINT, _CUE_TIME, _CUE_PLACES = 0x1C53BB6B, 0xBB, 0xB3, 0xB7
_CUE_TRACK, _CUE_CLUSTER = 0xF7, 0xF1
_AT_ONCE = 1 << 20


class WebmChangedError(WebmError):
    """The server's stream has another format than the recording began with."""


class WebmRecording:
    """Takes the elements of one or more connections; ``out`` None: only counts them.

    The head of the first connection serves all; a later one must be equal to it.
    """

    def __init__(self, out: Sink | None, seconds: float | None) -> None:
        self._out, self._limit = out, seconds
        self._head = b""
        self._arriving = b""
        self._first: int | None = None
        self._last = 0
        self.bytes = 0
        self.fragments = 0

    @property
    def seconds(self) -> float:
        """Media time from the first picture to the last."""
        return 0.0 if self._first is None else (self._last - self._first) / TICKS

    @property
    def begin(self) -> float | None:
        """Media time of the first picture in seconds; None before it."""
        return None if self._first is None else self._first / TICKS

    @property
    def media_time(self) -> float | None:
        """Media time of the last picture in seconds: pulse / fps; None before the first."""
        return None if self._first is None else self._last / TICKS

    def reconnected(self) -> None:
        """Begin with a new connection."""
        self._arriving = b""

    def take(self, element: Element) -> bool:
        """Take the next element; False when ``seconds`` are full: it is not taken.

        Raises:
            WebmError: not such a WebM.
            WebmChangedError: the format has changed.
        """
        if element.name != CLUSTER:
            self._arriving += element.data
            if len(self._arriving) > LARGEST:
                raise WebmError("elements without pictures")
            return True
        self._begin()
        time = cluster_time(element)
        first = time if self._first is None else self._first
        if self._first is not None and time <= self._last:
            return True  # sent again after a reconnection
        if self._first is not None and self._limit is not None and time - first >= self._limit * TICKS:
            return False
        self._write(at_time(element, time - first))
        self._first, self._last = first, time
        self.fragments += 1
        return True

    def _begin(self) -> None:
        """Write the head, or compare a later one with it."""
        head, self._arriving = self._arriving, b""
        if not head:
            return
        if self._head and head != self._head:
            raise WebmChangedError("the stream has changed its format; the recording ends before it")
        if not self._head:
            self._head = head
            self._write(head)

    def _write(self, data: bytes) -> None:
        if self._out is not None:
            self._out.write(data)
        self.bytes += len(data)


def write_indexed(part: Path, out: Path) -> None:
    """Make a recording into a file whose length is known and in which a player finds every key picture.

    Raises:
        OSError: it cannot be written.
        WebmError: it is no such recording.
    """
    head: list[Element] = []
    keys: list[tuple[int, int]] = []
    times: list[int] = []
    size = 0
    with part.open("rb") as source:
        for element in _elements(source):
            if element.name != CLUSTER:
                head.append(element)
                continue
            times.append(cluster_time(element))
            if is_key(element):
                keys.append((times[-1], size))
            size += len(element.data)
        if not times:
            raise WebmError("nothing was recorded")
        lasts = times[-1] - times[-2] if len(times) > 1 else 0
        source.seek(sum(len(element.data) for element in head))
        with out.open("wb") as film:
            film.write(_indexed_head(head, times[-1] + lasts, keys, size))
            while data := source.read(_AT_ONCE):
                film.write(data)


def _indexed_head(head: list[Element], length: int, keys: list[tuple[int, int]], clusters: int) -> bytes:
    before = b"".join(element.data for element in head[: _place(head, SEGMENT)])
    inside = b""
    for element in head[_place(head, SEGMENT) + 1 :]:
        more = made(_DURATION, struct.pack(">d", length)) if element.name == INFO else b""
        inside += made(element.name, element.content + more)
    inside += _cues(keys, len(inside) + len(_cues(keys, 0)))  # as long whatever the numbers in it
    segment = made(SEGMENT, b"")[:-8] + (len(inside) + clusters | 1 << 56).to_bytes(8, "big")
    return before + segment + inside


def _cues(keys: list[tuple[int, int]], clusters_at: int) -> bytes:
    """Return the index; places count from the beginning of the segment."""
    points = []
    for time, place in keys:
        places = number(_CUE_TRACK, 1, 1) + number(_CUE_CLUSTER, clusters_at + place)
        points.append(made(_CUE_POINT, number(_CUE_TIME, time) + made(_CUE_PLACES, places)))
    return made(_CUES, b"".join(points))


def _place(head: list[Element], name: int) -> int:
    for place, element in enumerate(head):
        if element.name == name:
            return place
    raise WebmError("a recording without a segment")


def _elements(source: BinaryIO) -> Iterator[Element]:
    reader = ElementReader()
    while data := source.read(_AT_ONCE):
        yield from reader.feed(data)
