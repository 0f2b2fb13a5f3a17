"""Frames out of clusters of WebM as the service makes them: one frame each, all sizes in four bytes."""

from __future__ import annotations

from collections.abc import Iterator

from server.service.rendering.worker.mp4_demuxer import Frame

_TICKS = 1000
_HEAD = 8
"""Bytes of a cluster's name and size."""
_TIME = 10
"""Bytes of the element that says its time."""
_SIMPLE_BLOCK, _BLOCK_GROUP, _BLOCK, _DURATION = 0xA3, 0xA0, 0xA1, 0x9B
_ELEMENT = 5
"""Bytes of the name and the size of what is inside."""
_FLAGS = 3
"""Bytes of a block before its flags: the track, and the time in the cluster."""
_KEY = 0x80


def webm_frames(clusters: bytes, fps: float) -> Iterator[Frame]:
    """Give the frames of clusters in order."""
    at = 0
    while at + _HEAD + _TIME + _ELEMENT <= len(clusters):
        end = at + _HEAD + _size(clusters, at + 4)
        time = int.from_bytes(clusters[at + _HEAD + 2 : at + _HEAD + _TIME], "big")
        block, lasts = b"", 1
        for name, content in _inside(clusters[at + _HEAD + _TIME : end]):
            if name in (_SIMPLE_BLOCK, _BLOCK):
                block = content
            elif name == _DURATION:
                lasts = max(1, round(int.from_bytes(content, "big") * fps / _TICKS))
        if len(block) <= _FLAGS:
            return
        yield Frame(round(time * fps / _TICKS), bool(block[_FLAGS] & _KEY), block[_FLAGS + 1 :], lasts)
        at = end


def _inside(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Give the elements in some bytes; in the place of a group, those in it."""
    at = 0
    while at + _ELEMENT <= len(data):
        end = at + _ELEMENT + _size(data, at + 1)
        content = data[at + _ELEMENT : end]
        if data[at] == _BLOCK_GROUP:
            yield from _inside(content)
        else:
            yield data[at], content
        at = end


def _size(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 4], "big") & 0x0FFFFFFF
