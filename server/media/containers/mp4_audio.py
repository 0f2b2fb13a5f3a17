"""Audio in fragmented MP4: AAC (ISO/IEC 14496-14) or Opus ("Encapsulation of Opus in ISOBMFF", 0.8.1)."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_boxes import box, full_box, moof_mdat, movie_header, track, track_defaults

AUDIO_TRACK = 2
"""Track 1 is the video."""
_FULL_VOLUME = 0x100


def audio_init_segment(audio: AudioFormat) -> bytes:
    """Return the init segment, ``ftyp`` and ``moov``, of an audio stream without video."""
    return box("ftyp", b"iso5" + struct.pack(">I", 512) + b"iso5iso6mp41") + box(
        "moov", movie_header(AUDIO_TRACK), audio_track(audio), box("mvex", track_defaults(AUDIO_TRACK))
    )


def audio_track(audio: AudioFormat) -> bytes:
    """Return the ``trak`` of audio; its timescale is the sample rate, so that no frame is rounded."""
    head = full_box("smhd", 0, 0, bytes(4))
    return track(AUDIO_TRACK, audio.rate, b"soun", head, _entry(audio), volume=_FULL_VOLUME)


def _entry(audio: AudioFormat) -> bytes:
    """Return the sample entry, with the decoder's configuration."""
    kind = {"aac": "mp4a", "opus": "Opus"}[audio.coding]
    return box(
        kind,
        bytes(6) + struct.pack(">H", 1) + bytes(8)
        + struct.pack(">4HI", audio.channels, 16, 0, 0, audio.rate << 16),
        _esds(audio) if audio.coding == "aac" else _dops(audio),
    )  # fmt: skip


def _dops(audio: AudioFormat) -> bytes:
    """Return OpusSpecificBox (4.3.2), without pre-skip: players join in mid-stream."""
    return box("dOps", struct.pack(">BBHIhB", 0, audio.channels, 0, audio.rate, 0, 0))


def _esds(audio: AudioFormat) -> bytes:
    """Return ESDBox with the descriptors of AAC (ISO/IEC 14496-1, 7.2.6)."""
    decoder = b"\x40\x15" + bytes(11) + _descriptor(5, audio.aac_config)
    stream = struct.pack(">HB", AUDIO_TRACK, 0) + _descriptor(4, decoder) + _descriptor(6, b"\x02")
    return full_box("esds", 0, 0, _descriptor(3, stream))


def _descriptor(tag: int, body: bytes) -> bytes:
    return bytes([tag, len(body)]) + body


def audio_fragment(audio: AudioFormat, frames: Sequence[bytes], first: int, origin: int = 0) -> bytes:
    """Return ``moof`` and ``mdat`` of consecutive audio frames, the first of which has number ``first``.

    ``origin`` is the sample that is at time 0.
    """
    sizes = struct.pack(f">{len(frames)}I", *map(len, frames))
    track_head = full_box("tfhd", 0, 0x020008, struct.pack(">2I", AUDIO_TRACK, audio.samples))
    return moof_mdat(first, track_head, first * audio.samples - origin, 0x000201, sizes, frames)
