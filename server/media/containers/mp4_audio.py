"""Sound in fragmented MP4: AAC (ISO/IEC 14496-14) or Opus ("Encapsulation of Opus in ISOBMFF", 0.8.1)."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_boxes import box, full, moof_mdat, movie_head, track, track_defaults

SOUND_TRACK = 2
"""Pictures are track 1."""
_FULL_VOLUME = 0x100


def audio_init_segment(sound: AudioFormat) -> bytes:
    """Return ``ftyp`` and ``moov`` for the sound alone."""
    return box("ftyp", b"iso5" + struct.pack(">I", 512) + b"iso5iso6mp41") + box(
        "moov", movie_head(SOUND_TRACK), audio_track(sound), box("mvex", track_defaults(SOUND_TRACK))
    )


def audio_track(sound: AudioFormat) -> bytes:
    """Return the ``trak`` of sound; its clock ticks once a sample, so that no frame is rounded."""
    head = full("smhd", 0, 0, bytes(4))
    return track(SOUND_TRACK, sound.rate, b"soun", head, _entry(sound), volume=_FULL_VOLUME)


def _entry(sound: AudioFormat) -> bytes:
    """Return the sample entry, which says all that a decoder has to be told."""
    kind = {"aac": "mp4a", "opus": "Opus"}[sound.coding]
    return box(
        kind,
        bytes(6) + struct.pack(">H", 1) + bytes(8)
        + struct.pack(">4HI", sound.channels, 16, 0, 0, sound.rate << 16),
        _esds(sound) if sound.coding == "aac" else _dops(sound),
    )  # fmt: skip


def _dops(sound: AudioFormat) -> bytes:
    """Return the box about Opus (4.3.2): nothing is skipped at the beginning, since a stream has none."""
    return box("dOps", struct.pack(">BBHIhB", 0, sound.channels, 0, sound.rate, 0, 0))


def _esds(sound: AudioFormat) -> bytes:
    """Return the descriptors of AAC (ISO/IEC 14496-1, 7.2.6)."""
    decoder = b"\x40\x15" + bytes(11) + _descriptor(5, sound.config)
    stream = struct.pack(">HB", SOUND_TRACK, 0) + _descriptor(4, decoder) + _descriptor(6, b"\x02")
    return full("esds", 0, 0, _descriptor(3, stream))


def _descriptor(tag: int, body: bytes) -> bytes:
    return bytes([tag, len(body)]) + body


def audio_fragment(sound: AudioFormat, frames: Sequence[bytes], first: int, origin: int = 0) -> bytes:
    """Return ``moof`` and ``mdat`` of consecutive frames of sound, of which the first has number ``first``.

    ``origin`` is the sample that is at time 0.
    """
    sizes = struct.pack(f">{len(frames)}I", *map(len, frames))
    track_head = full("tfhd", 0, 0x020008, struct.pack(">2I", SOUND_TRACK, sound.samples))
    return moof_mdat(first, track_head, first * sound.samples - origin, 0x000201, sizes, frames)
