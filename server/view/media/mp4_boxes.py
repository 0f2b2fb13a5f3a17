"""Boxes of MP4 (ISO/IEC 14496-12), and those that tracks of all kinds share."""

from __future__ import annotations

import struct

MATRIX = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
"""Neither turned nor scaled."""


def box(kind: str, *parts: bytes) -> bytes:
    """Give a box."""
    body = b"".join(parts)
    return struct.pack(">I", 8 + len(body)) + kind.encode("ascii") + body


def full(kind: str, version: int, flags: int, body: bytes) -> bytes:
    """Give a box that says its version and has flags (4.2)."""
    return box(kind, struct.pack(">I", version << 24 | flags), body)


def movie_head(last: int) -> bytes:
    """Give ``mvhd`` of a film whose tracks are numbered up to ``last``."""
    head = struct.pack(">5I", 0, 0, 1000, 0, 0x10000) + struct.pack(">H", 0x100) + bytes(10)
    return full("mvhd", 0, 0, head + MATRIX + bytes(24) + struct.pack(">I", last + 1))


def track_defaults(track: int) -> bytes:
    """Give ``trex`` of a track whose fragments say everything themselves."""
    return full("trex", 0, 0, struct.pack(">5I", track, 1, 0, 0, 0))
