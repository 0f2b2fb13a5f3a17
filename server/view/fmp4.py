"""Fragmented MP4 by hand (ISO/IEC 14496-12 and -15): pictures, perhaps sound, and fragments that stand alone.

A library's muxer keeps a fragment back until it knows the next packet, and builds every stream anew. Here a
fragment is made once per camera and frame, and every stream is a list of references to such fragments.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from server.wire.h264 import ParameterSets
from server.wire.sound import FRAME, SoundFormat

TIMESCALE = 90_000
"""Ticks a second: divisible by 24, 25, 30 and 50 frames a second."""

_TRACK = 1
_SOUND_TRACK = 2
_SYNC_SAMPLE = 0x02000000
"""sample_depends_on = 2: an I picture (8.8.3.1)."""
_OTHER_SAMPLE = 0x01010000
"""sample_depends_on = 1, sample_is_non_sync_sample."""
_TFDT_AT = 8 + 16 + 8 + 16 + 12
"""Where a fragment's decode time stands: behind the heads of moof, mfhd, traf, tfhd and tfdt."""
_MATRIX = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)


@dataclass(frozen=True, slots=True)
class Sample:
    """One frame ready for a fragment."""

    data: bytes
    """NAL units behind their lengths."""
    key: bool
    lasts: int = 1
    """Pulses that it is shown for."""


def ticks(pulse: int, fps: float) -> int:
    """Give the presentation time of a pulse: the media time of a frame is exactly pulse / fps."""
    return round(pulse * TIMESCALE / fps)


def init_segment(
    parameters: ParameterSets, width: int, height: int, sound: SoundFormat | None = None
) -> bytes:
    """Give ``ftyp`` and ``moov``: what a player needs before the first fragment, the same for all streams."""
    last = _TRACK if sound is None else _SOUND_TRACK
    return (
        _box("ftyp", b"iso5" + struct.pack(">I", 512) + b"iso5iso6avc1mp41")
        + _box(
            "moov",
            _movie_head(last),
            _box(
                "trak",
                _full("tkhd", 0, 3, struct.pack(">5I", 0, 0, _TRACK, 0, 0) + bytes(16) + _MATRIX
                      + struct.pack(">2I", width << 16, height << 16)),
                _box(
                    "mdia",
                    _full("mdhd", 0, 0, struct.pack(">4I2H", 0, 0, TIMESCALE, 0, 0x55C4, 0)),
                    _full("hdlr", 0, 0, bytes(4) + b"vide" + bytes(12) + b"MyView\x00"),
                    _box(
                        "minf",
                        _full("vmhd", 0, 1, bytes(8)),
                        _box("dinf", _full("dref", 0, 0, struct.pack(">I", 1) + _full("url ", 0, 1, b""))),
                        _box(
                            "stbl",
                            _full("stsd", 0, 0, struct.pack(">I", 1) + _avc1(parameters, width, height)),
                            _full("stts", 0, 0, bytes(4)),
                            _full("stsc", 0, 0, bytes(4)),
                            _full("stsz", 0, 0, bytes(8)),
                            _full("stco", 0, 0, bytes(4)),
                        ),
                    ),
                ),
            ),
            b"" if sound is None else _sound_track(sound),
            _box("mvex", *(_defaults(track + 1) for track in range(last))),
        )
    )  # fmt: skip


def sound_init_segment(sound: SoundFormat) -> bytes:
    """Give the same for the sound alone."""
    return _box("ftyp", b"iso5" + struct.pack(">I", 512) + b"iso5iso6mp41") + _box(
        "moov", _movie_head(_SOUND_TRACK), _sound_track(sound), _box("mvex", _defaults(_SOUND_TRACK))
    )


def _movie_head(last: int) -> bytes:
    head = struct.pack(">5I", 0, 0, 1000, 0, 0x10000) + struct.pack(">H", 0x100) + bytes(10)
    return _full("mvhd", 0, 0, head + _MATRIX + bytes(24) + struct.pack(">I", last + 1))


def _defaults(track: int) -> bytes:
    return _full("trex", 0, 0, struct.pack(">5I", track, 1, 0, 0, 0))


def _sound_track(sound: SoundFormat) -> bytes:
    """Give the ``trak`` of AAC; its clock ticks once a sample, so that no frame is rounded."""
    return _box(
        "trak",
        _full("tkhd", 0, 3, struct.pack(">5I", 0, 0, _SOUND_TRACK, 0, 0) + bytes(8)
              + struct.pack(">4H", 0, 0, 0x100, 0) + _MATRIX + bytes(8)),
        _box(
            "mdia",
            _full("mdhd", 0, 0, struct.pack(">4I2H", 0, 0, sound.rate, 0, 0x55C4, 0)),
            _full("hdlr", 0, 0, bytes(4) + b"soun" + bytes(12) + b"MyView\x00"),
            _box(
                "minf",
                _full("smhd", 0, 0, bytes(4)),
                _box("dinf", _full("dref", 0, 0, struct.pack(">I", 1) + _full("url ", 0, 1, b""))),
                _box(
                    "stbl",
                    _full("stsd", 0, 0, struct.pack(">I", 1) + _mp4a(sound)),
                    _full("stts", 0, 0, bytes(4)),
                    _full("stsc", 0, 0, bytes(4)),
                    _full("stsz", 0, 0, bytes(8)),
                    _full("stco", 0, 0, bytes(4)),
                ),
            ),
        ),
    )  # fmt: skip


def _mp4a(sound: SoundFormat) -> bytes:
    """Give the sample entry of AAC, with its descriptors (ISO/IEC 14496-1, 7.2.6)."""
    decoder = b"\x40\x15" + bytes(11) + _descriptor(5, sound.config)
    stream = struct.pack(">HB", _SOUND_TRACK, 0) + _descriptor(4, decoder) + _descriptor(6, b"\x02")
    return _box(
        "mp4a",
        bytes(6) + struct.pack(">H", 1) + bytes(8)
        + struct.pack(">4HI", sound.channels, 16, 0, 0, sound.rate << 16),
        _full("esds", 0, 0, _descriptor(3, stream)),
    )  # fmt: skip


def _descriptor(tag: int, body: bytes) -> bytes:
    return bytes([tag, len(body)]) + body


def sound_fragment(frames: Sequence[bytes], first: int) -> bytes:
    """Give ``moof`` and ``mdat`` of consecutive frames of sound, which begin with sample number ``first``."""
    sizes = struct.pack(f">{len(frames)}I", *map(len, frames))
    header = _full("mfhd", 0, 0, struct.pack(">I", (first // FRAME + 1) & 0xFFFFFFFF))
    track = _full("tfhd", 0, 0x020008, struct.pack(">2I", _SOUND_TRACK, FRAME)) + _full(
        "tfdt", 1, 0, struct.pack(">Q", first)
    )
    moof_bytes = 8 + len(header) + 8 + len(track) + 8 + 4 + 4 + 4 + len(sizes)
    run = _full("trun", 0, 0x000201, struct.pack(">Ii", len(frames), moof_bytes + 8) + sizes)
    return _box("moof", header, _box("traf", track, run)) + _box("mdat", *frames)


def fragment(samples: Sequence[Sample], first: int, fps: float) -> bytes:
    """Give ``moof`` and ``mdat`` of consecutive frames, the first of them shown at pulse ``first``."""
    pulses = accumulate((sample.lasts for sample in samples), initial=first)
    return _fragment(samples, first, [ticks(pulse, fps) for pulse in pulses])


def still(samples: Sequence[Sample], first: int, until: int, fps: float) -> bytes:
    """Give a fragment that shows the last of some frames: those before it pass in a tick each."""
    begin = ticks(first, fps)
    return _fragment(samples, first, [*(begin + place for place in range(len(samples))), ticks(until, fps)])


def _fragment(samples: Sequence[Sample], first: int, edges: Sequence[int]) -> bytes:
    """Give the fragment of samples, each shown from its edge to the next, in ticks."""
    entries = b"".join(
        struct.pack(
            ">3I",
            edges[number + 1] - edges[number],
            len(sample.data),
            _SYNC_SAMPLE if sample.key else _OTHER_SAMPLE,
        )
        for number, sample in enumerate(samples)
    )
    # The sequence number only has to grow; taken from the pulse, a fragment fits into any stream.
    header = _full("mfhd", 0, 0, struct.pack(">I", (first + 1) & 0xFFFFFFFF))
    track = _full("tfhd", 0, 0x020000, struct.pack(">I", _TRACK)) + _full(
        "tfdt", 1, 0, struct.pack(">Q", edges[0])
    )
    run_bytes = 8 + 4 + 4 + 4 + len(entries)
    moof_bytes = 8 + len(header) + 8 + len(track) + run_bytes
    run = _full("trun", 0, 0x000701, struct.pack(">Ii", len(samples), moof_bytes + 8) + entries)
    return _box("moof", header, _box("traf", track, run)) + _box("mdat", *(s.data for s in samples))


def _avc1(parameters: ParameterSets, width: int, height: int) -> bytes:
    sps, pps = parameters.sps, parameters.pps
    configuration = (
        b"\x01" + sps[1:4] + b"\xff\xe1" + struct.pack(">H", len(sps)) + sps
        + b"\x01" + struct.pack(">H", len(pps)) + pps
    )  # fmt: skip
    return _box(
        "avc1",
        bytes(6) + struct.pack(">H", 1) + bytes(16) + struct.pack(">2H", width, height)
        + struct.pack(">2I", 0x480000, 0x480000) + bytes(4) + struct.pack(">H", 1) + bytes(32)
        + struct.pack(">Hh", 24, -1),
        _box("avcC", configuration),
    )  # fmt: skip


def _box(kind: str, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return struct.pack(">I", 8 + len(body)) + kind.encode("ascii") + body


def _full(kind: str, version: int, flags: int, body: bytes) -> bytes:
    return _box(kind, struct.pack(">I", version << 24 | flags), body)


def rebased(frame: bytes, by: int) -> bytes:
    """Move a fragment of :func:`fragment` in time by ``by`` ticks."""
    (time,) = struct.unpack_from(">Q", frame, _TFDT_AT)
    return frame[:_TFDT_AT] + struct.pack(">Q", time + by) + frame[_TFDT_AT + 8 :]


def sample_of(frame: bytes) -> bytes:
    """Give the sample of a fragment of :func:`fragment` that has one."""
    (moof_bytes,) = struct.unpack_from(">I", frame)
    return frame[moof_bytes + 8 :]
