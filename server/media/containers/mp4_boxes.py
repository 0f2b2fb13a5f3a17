"""Builders of MP4 boxes (ISO/IEC 14496-12) that video and audio tracks share."""

from __future__ import annotations

import struct
from collections.abc import Sequence

_MATRIX = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
"""The unity matrix: no rotation, no scaling."""


def box(kind: str, *parts: bytes) -> bytes:
    """Return a box."""
    body = b"".join(parts)
    return struct.pack(">I", 8 + len(body)) + kind.encode("ascii") + body


def full_box(kind: str, version: int, flags: int, body: bytes) -> bytes:
    """Return a FullBox, which has version and flags (4.2)."""
    return box(kind, struct.pack(">I", version << 24 | flags), body)


def movie_header(last_track: int) -> bytes:
    """Return ``mvhd`` of a movie whose tracks are numbered up to ``last_track``."""
    head = struct.pack(">5I", 0, 0, 1000, 0, 0x10000) + struct.pack(">H", 0x100) + bytes(10)
    return full_box("mvhd", 0, 0, head + _MATRIX + bytes(24) + struct.pack(">I", last_track + 1))


def track_defaults(track: int) -> bytes:
    """Return ``trex`` of a track whose fragments use no defaults."""
    return full_box("trex", 0, 0, struct.pack(">5I", track, 1, 0, 0, 0))


def track(
    number: int,
    timescale: int,
    handler: bytes,
    head: bytes,
    entry: bytes,
    *,
    volume: int = 0,
    size: tuple[int, int] = (0, 0),
) -> bytes:
    """Return ``trak`` of a track whose samples are all in fragments.

    ``head`` is the media header box (``vmhd``, ``smhd``), ``entry`` the sample entry; ``size`` is in pixels.
    """
    width, height = size
    return box(
        "trak",
        full_box("tkhd", 0, 3, struct.pack(">5I", 0, 0, number, 0, 0) + bytes(8)
              + struct.pack(">4H", 0, 0, volume, 0) + _MATRIX
              + struct.pack(">2I", width << 16, height << 16)),
        box(
            "mdia",
            full_box("mdhd", 0, 0, struct.pack(">4I2H", 0, 0, timescale, 0, 0x55C4, 0)),
            full_box("hdlr", 0, 0, bytes(4) + handler + bytes(12) + b"MyView\x00"),
            box(
                "minf",
                head,
                box("dinf", full_box("dref", 0, 0, struct.pack(">I", 1) + full_box("url ", 0, 1, b""))),
                box(
                    "stbl",
                    full_box("stsd", 0, 0, struct.pack(">I", 1) + entry),
                    full_box("stts", 0, 0, bytes(4)),
                    full_box("stsc", 0, 0, bytes(4)),
                    full_box("stsz", 0, 0, bytes(8)),
                    full_box("stco", 0, 0, bytes(4)),
                ),
            ),
        ),
    )  # fmt: skip


def moof_mdat(
    first: int, track_head: bytes, time: int, flags: int, entries: bytes, samples: Sequence[bytes]
) -> bytes:
    """Return a fragment: ``moof``, and the samples in ``mdat``.

    ``first`` is the first sample's number, ``time`` its decode time; ``track_head`` is ``tfhd``. ``flags``
    and ``entries`` are those of ``trun``: the fields of each sample, and their values.
    """
    # Sequence numbers need only ascend: derived from the sample's number, they do so in any stream.
    header = full_box("mfhd", 0, 0, struct.pack(">I", (first + 1) & 0xFFFFFFFF))
    track_boxes = track_head + full_box("tfdt", 1, 0, struct.pack(">Q", time))
    moof_bytes = 8 + len(header) + 8 + len(track_boxes) + 8 + 4 + 4 + 4 + len(entries)
    run = full_box("trun", 0, flags, struct.pack(">Ii", len(samples), moof_bytes + 8) + entries)
    return box("moof", header, box("traf", track_boxes, run)) + box("mdat", *samples)
