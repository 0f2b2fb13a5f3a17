"""WebM muxer (RFC 9559, in EBML, RFC 8794): a header of unknown length, and one cluster per frame.

A cluster adds about twenty bytes. In return each frame carries its time, as an MP4 fragment does, and can
follow any other.
"""

from __future__ import annotations

import struct

TICKS = 1000
"""Ticks per second: WebM counts in milliseconds."""

_UNKNOWN = b"\x01" + b"\xff" * 7
"""The unknown size (RFC 8794, 6.2), of a live stream."""
CLUSTER = b"\x1f\x43\xb6\x75"
"""The element ID of a cluster."""
_SEGMENT = b"\x18\x53\x80\x67"
_TIMESTAMP, _SIMPLE_BLOCK, _BLOCK_GROUP, _BLOCK = b"\xe7", b"\xa3", b"\xa0", b"\xa1"
_BLOCK_DURATION, _REFERENCE = b"\x9b", b"\xfb"
_TRACK = b"\x81"
_KEY = 0x80
_TIME_AT = len(CLUSTER) + 4 + len(_TIMESTAMP) + 1
"""The offset of the time, after the headers of the cluster and of the time element."""


def ticks(pulse: int, fps: float) -> int:
    """Return the presentation time of a pulse in ticks, unique up to 500 frames per second."""
    return round(pulse * TICKS / fps)


def header(width: int, height: int, fps: float, frames: int | None = None) -> bytes:
    """Return the initialization segment; ``frames`` is the length of a file, None for a live stream."""
    info = _number(b"\x2a\xd7\xb1", 1_000_000_000 // TICKS) + _text(b"\x4d\x80", "MyView")
    info += _text(b"\x57\x41", "MyView")
    if frames is not None:
        info += _element(b"\x44\x89", struct.pack(">d", ticks(frames, fps)))
    video = _number(b"\xb0", width) + _number(b"\xba", height)
    track = b"".join((
        _number(b"\xd7", 1),  # TrackNumber
        _number(b"\x73\xc5", 1),  # TrackUID
        _number(b"\x83", 1),  # TrackType: video
        _number(b"\x9c", 0),  # FlagLacing
        _text(b"\x22\xb5\x9c", "und"),
        _text(b"\x86", "V_VP8"),
        _number(b"\x23\xe3\x83", round(1e9 / fps)),  # DefaultDuration
        _element(b"\xe0", video),
    ))  # fmt: skip
    ebml = _number(b"\x42\x86", 1) + _number(b"\x42\xf7", 1) + _number(b"\x42\xf2", 4)
    ebml += _number(b"\x42\xf3", 8) + _text(b"\x42\x82", "webm")
    ebml += _number(b"\x42\x87", 4) + _number(b"\x42\x85", 2)
    return b"".join((
        _element(b"\x1a\x45\xdf\xa3", ebml),
        _SEGMENT + _UNKNOWN,
        _element(b"\x15\x49\xa9\x66", info),
        _element(b"\x16\x54\xae\x6b", _element(b"\xae", track)),
    ))  # fmt: skip


def cluster(frame: bytes, pulse: int, fps: float, *, key: bool, duration: int = 1) -> bytes:
    """Return a frame as a cluster; ``duration`` in pulses is stated if it is more than one."""
    time = ticks(pulse, fps)
    head = _TRACK + struct.pack(">h", 0)  # relative to the cluster's time
    if duration == 1:
        block = _element(_SIMPLE_BLOCK, head + bytes([_KEY * key]) + frame)
    else:
        inside = _element(_BLOCK, head + b"\x00" + frame)
        inside += _number(_BLOCK_DURATION, ticks(pulse + duration, fps) - time)
        if not key:
            inside += _element(_REFERENCE, struct.pack(">b", -1))  # any earlier time means the frame before
        block = _element(_BLOCK_GROUP, inside)
    return CLUSTER + _size(8 + 2 + len(block)) + _TIMESTAMP + b"\x88" + struct.pack(">Q", time) + block


def pulse_of(cluster: bytes, fps: float) -> int:
    """Return the pulse of a cluster of :func:`cluster`."""
    (time,) = struct.unpack_from(">Q", cluster, _TIME_AT)
    return round(int(time) * fps / TICKS)


def shift_cluster(cluster: bytes, by_ticks: int) -> bytes:
    """Return a cluster of :func:`cluster` moved in time."""
    (time,) = struct.unpack_from(">Q", cluster, _TIME_AT)
    return cluster[:_TIME_AT] + struct.pack(">Q", time + by_ticks) + cluster[_TIME_AT + 8 :]


def _element(name: bytes, content: bytes) -> bytes:
    return name + _size(len(content)) + content


def _number(name: bytes, value: int) -> bytes:
    return _element(name, value.to_bytes(max(1, (value.bit_length() + 7) // 8), "big"))


def _text(name: bytes, value: str) -> bytes:
    return _element(name, value.encode("ascii"))


def _size(size: int) -> bytes:
    """Return a size, always in four bytes, so that the time of a cluster has a fixed offset."""
    return (size | 1 << 28).to_bytes(4, "big")
