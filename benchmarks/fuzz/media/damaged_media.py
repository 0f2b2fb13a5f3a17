"""Damage to media, and valid streams to damage."""

from __future__ import annotations

from random import Random
from typing import Literal

from benchmarks.fuzz.engine.fed_site import FPS, HEIGHT, WIDTH, pictures
from benchmarks.fuzz.engine.mutations import mutate_bytes
from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_audio import audio_fragment
from server.media.stream_format import StreamFormat
from server.media.vp8.stream_format import Vp8StreamFormat

WORDS = (
    b"\x00\x00\x01", b"\x00\x00\x00\x01", b"\x00\x00\x01\x67", b"\x00\x00\x01\x68", b"\x00\x00\x01\x65",
    b"\x00\x00\x03", b"\x00" * 40, b"\xff" * 40, b"\x00\x00\x00\x00", b"\x00\x00\x00\x08",
    b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff", b"\x00\x00\x00\x01\xff\xff\xff\xff\xff\xff\xff\xff", b"moof",
    b"mdat", b"moov", b"trak", b"tfdt", b"trun", b"soun", b"\x1f\x43\xb6\x75", b"\x18\x53\x80\x67",
    b"\xe7\x88", b"\xa3\x81", b"\xa0\x81", b"\x01\xff\xff\xff\xff\xff\xff\xff", b"\x9d\x01\x2a",
)  # fmt: skip


def damage_media(rng: Random, data: bytes) -> bytes:
    """Return the bytes with damage typical for media."""
    return mutate_bytes(rng, data, WORDS)


def stream(codec: Literal["h264", "vp8"], frames: int = 10) -> bytes:
    """Return a viewer's stream of some GOPs."""
    stream_format = Vp8StreamFormat(WIDTH, HEIGHT) if codec == "vp8" else None
    form, units = AudioFormat(48_000, 2), pictures(0, frames, codec)
    if stream_format is None:
        found = StreamFormat()
        found.accept(units[0].data)
        head = found.init_segment((WIDTH, HEIGHT), FPS, form) or b""
        sound = audio_fragment(form, [form.silence] * 9, 0)
        return head + sound + b"".join(found.pack(unit.data, unit.pulse, FPS, key=unit.key) for unit in units)
    head = stream_format.init_segment((WIDTH, HEIGHT), FPS)
    return head + b"".join(stream_format.pack(unit.data, unit.pulse, FPS, key=unit.key) for unit in units)
