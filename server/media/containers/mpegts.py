"""MPEG transport stream muxer (ISO/IEC 13818-1): one program with video and optional audio.

The packets of a PID are counted modulo 16 (continuity_counter). A GOP is packed once for all viewers, and any
GOP must be able to follow any other, so each is stuffed to a multiple of 16 packets: all begin at 0. That
costs 7.5 packets per GOP on average.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from server.media.audio.audio_chunk import AudioChunk
from server.media.containers.fmp4 import ticks
from server.media.nal_units import split_sample
from server.media.picture import Codec, EncodedPicture
from server.media.rendering_messages import TIMESCALE

PACKET_BYTES = 188
COUNTERS = 16
"""Packets after which the continuity counter wraps around."""

_PAT_PID, _PMT_PID, _VIDEO_PID, _AUDIO_PID = 0x0000, 0x1000, 0x0100, 0x0101
_VIDEO_TYPES: dict[Codec, int] = {"h264": 0x1B, "h265": 0x24, "vp8": 0x06}
_AAC = 0x0F
"""stream_type."""
_CLOCK = 1 << 33
"""Time stamps are modulo this (2.4.3.7)."""
_DELAY = TIMESCALE // 5
"""Ticks from the program clock reference to the presentation time: the decoder's buffering delay."""
_PCR_EVERY = TIMESCALE // 10
"""The longest interval of the program clock reference (2.7.2)."""
_PAYLOAD = PACKET_BYTES - 4
_PCR_FIELD = 8
"""Bytes of an adaptation field with a program clock reference."""
_AUD: dict[Codec, bytes] = {
    "h264": b"\x00\x00\x00\x01\x09\xf0",
    "h265": b"\x00\x00\x00\x01\x46\x01\x50",
    "vp8": b"",  # which is not carried
}
"""Access unit delimiter: begins every picture in a transport stream (2.14.1, 2.17.1)."""
_START_CODE = b"\x00\x00\x00\x01"
_PES_HEAD = 14
_FRAMES_PER_PES = 6
"""Audio frames per PES packet, whose length field has 16 bits."""


@dataclass(frozen=True, slots=True)
class ContinuityCounters:
    """Packets sent of each PID so far, modulo 16 (continuity_counter, 2.4.3.3)."""

    tables: int = 0
    video: int = 0
    audio: int = 0
    aligned: bool = True
    """Whether to stuff to a multiple of 16 packets, so that any GOP can follow."""


def count_packets(picture: EncodedPicture) -> int:
    """Return the number of packets of a picture, without packets that are only stuffing."""
    return _packets(_PES_HEAD + len(_AUD[picture.codec]) + len(picture.sample))


def count_audio_packets(audio: AudioChunk) -> int:
    """Return the number of packets of some audio; 0 for Opus, which is not carried."""
    return sum(_plain_packets(len(content)) for content in _audio_pes(audio))


def pack(
    pictures: Sequence[EncodedPicture],
    fps: float,
    counters: ContinuityCounters,
    audio: AudioChunk | None = None,
) -> bytes:
    """Return consecutive pictures as packets, preceded by their audio if that is AAC.

    The tables precede each aligned GOP and each keyframe.
    """
    out: list[bytes] = []
    audio = audio if audio is not None and audio.format.coding == "aac" else None
    if counters.aligned or pictures[0].key:
        out += [
            _table(_PAT_PID, _PAT, counters.tables),
            _table(_PMT_PID, _program_map(pictures[0].codec, has_audio=audio is not None), counters.tables),
        ]
    if audio is not None:
        out += _pack_audio(audio, counters)
    counter = counters.video
    for index, picture in enumerate(pictures):
        content = _pes(picture, fps)
        count = _packets(len(content))
        if counters.aligned and index == len(pictures) - 1:
            count += -(counter + count) % COUNTERS
        time = ticks(picture.pulse, fps)
        out += _split(_VIDEO_PID, content, count, counter, _clock_reference(time, key=picture.key))
        counter = (counter + count) % COUNTERS
        for reference_time in range(time + _PCR_EVERY, ticks(picture.until, fps), _PCR_EVERY):
            out.append(_packet(_VIDEO_PID, counter - 1, b"", _clock_reference(reference_time)))
    return b"".join(out)


def _pack_audio(audio: AudioChunk, counters: ContinuityCounters) -> Iterator[bytes]:
    counter, contents = counters.audio, _audio_pes(audio)
    for index, content in enumerate(contents):
        count = _plain_packets(len(content))
        if counters.aligned and index == len(contents) - 1:
            count += -(counter + count) % COUNTERS
        yield from _split(_AUDIO_PID, content, count, counter, b"")
        counter = (counter + count) % COUNTERS


def _audio_pes(audio: AudioChunk) -> list[bytes]:
    """Return audio as PES packets; each frame has an ADTS header."""
    audio_format, packets = audio.format, list[bytes]()
    for start in range(0, len(audio.frames) if audio_format.coding == "aac" else 0, _FRAMES_PER_PES):
        stamp = _stamp(
            round((audio.first + start) * audio_format.samples * TIMESCALE / audio_format.rate) % _CLOCK
        )
        frames = audio.frames[start : start + _FRAMES_PER_PES]
        content = b"".join(audio_format.adts(len(frame)) + frame for frame in frames)
        packets.append(
            struct.pack(">IHBBB", 0x1C0, 3 + len(stamp) + len(content), 0x84, 0x80, 5) + stamp + content
        )
    return packets


def _plain_packets(content: int) -> int:
    return -(-content // _PAYLOAD)


def _packets(content: int) -> int:
    return 1 + max(0, -(-(content - _PAYLOAD + _PCR_FIELD) // _PAYLOAD))


def _pes(picture: EncodedPicture, fps: float) -> bytes:
    """Return a picture as a PES packet (2.4.3.6) with its time, and its length if that fits."""
    time = ticks(picture.pulse, fps) % _CLOCK
    stamp = _stamp(time)
    content = _AUD[picture.codec] + b"".join(_annex_b(picture.sample))
    length = 3 + len(stamp) + len(content)
    # 0x84: data_alignment_indicator; 0x80: a PTS, but no DTS.
    head = struct.pack(">IHBBB", 0x1E0, length if length < 1 << 16 else 0, 0x84, 0x80, len(stamp))
    return head + stamp + content


def _stamp(time: int) -> bytes:
    return struct.pack(">BHH", 0x21 | time >> 29 & 0x0E, time >> 14 & 0xFFFE | 1, time << 1 & 0xFFFE | 1)


def _annex_b(sample: bytes) -> Iterator[bytes]:
    for unit in split_sample(sample):
        yield _START_CODE
        yield unit


def _clock_reference(time: int, *, key: bool = False) -> bytes:
    """Return an adaptation field's flags and program clock reference (2.4.3.4)."""
    base = (time - _DELAY) % _CLOCK
    return struct.pack(">BIH", 0x10 | 0x40 * key, base >> 1, (base & 1) << 15 | 0x7E00)


def _split(pid: int, content: bytes, count: int, counter: int, clock_reference: bytes) -> Iterator[bytes]:
    """Yield ``count`` packets of the content: full ones first, and at least one byte in each."""
    at = 0
    for index in range(count):
        field = clock_reference if index == 0 else b""
        room = _PAYLOAD - (1 + len(field) if field else 0)
        size = min(room, len(content) - at - (count - 1 - index))
        yield _packet(pid, counter + index, content[at : at + size], field, begins=index == 0)
        at += size


def _packet(pid: int, counter: int, payload: bytes, field: bytes = b"", *, begins: bool = False) -> bytes:
    """Return a packet; ``field`` is an adaptation field without its length, stuffed to fill the packet."""
    room = _PAYLOAD - len(payload)
    control = 0x10 * bool(payload)
    if room:
        control |= 0x20
        stuffed = (field or b"\x00") if room > 1 else b""
        field = bytes([room - 1]) + stuffed.ljust(room - 1, b"\xff")
    return struct.pack(">BHB", 0x47, begins << 14 | pid, control | counter % COUNTERS) + field + payload


def _table(pid: int, section: bytes, counter: int) -> bytes:
    payload = (b"\x00" + section).ljust(_PAYLOAD, b"\xff")
    return _packet(pid, counter, payload, begins=True)


def _section(table: int, number: int, body: bytes) -> bytes:
    """Return a table of a single section (2.4.4.3, 2.4.4.8), version 0, current."""
    content = struct.pack(">HBBB", number, 0xC1, 0, 0) + body
    head = struct.pack(">BH", table, 0xB000 | len(content) + 4) + content
    return head + struct.pack(">I", _crc(head))


def _crc(data: bytes) -> int:
    """Return CRC_32 of annex A."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc & 1 << 31 else 0)) & 0xFFFFFFFF
    return crc


_PAT = _section(0, 1, struct.pack(">HH", 1, 0xE000 | _PMT_PID))


@lru_cache
def _program_map(codec: Codec, *, has_audio: bool) -> bytes:
    """Return the program map table (2.4.4.8)."""
    streams = struct.pack(
        ">HHBHH", 0xE000 | _VIDEO_PID, 0xF000, _VIDEO_TYPES[codec], 0xE000 | _VIDEO_PID, 0xF000
    )
    if has_audio:
        streams += struct.pack(">BHH", _AAC, 0xE000 | _AUDIO_PID, 0xF000)
    return _section(2, 1, streams)
