"""Check that each frame of a stream is the selected camera's, pixel by pixel, in each container format."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import av
import numpy as np

from benchmarks.streaming.splice_cost import SplicerFixture
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import CameraSettings, EncodeSettings, SiteSettings
from server.config.site_config import Config
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Chunk

_SITE = SiteSettings(name="right", width=64, height=48, fps=25)
_ENCODE = EncodeSettings()
_CAMERAS = 4
_BLOCK = 8
"""Pixels of one color: large enough to survive encoding."""


@dataclass(frozen=True, slots=True)
class FrameCorrectness:
    """The numbers of correct frames."""

    frames: int
    cuts: int
    in_file: int
    """Correct frames in MP4, or in WebM for VP8."""
    in_ts: int | None
    """Correct frames in the transport stream; VP8 has none."""
    ambiguous: int
    """Pulses at which two cameras have equal frames, so that a wrong frame would go unnoticed."""


def films(frames: int, seed: int, encode: EncodeSettings = _ENCODE) -> list[list[AccessUnit]]:
    """Encode pictures of random colors for each camera, all different."""
    rng, encoded = np.random.default_rng(seed), []
    for _ in range(_CAMERAS):
        encoder = Encoder(_SITE, encode)
        film = []
        for pulse in range(frames):
            size = (_SITE.height // _BLOCK, _SITE.width // _BLOCK, 3)
            blocks = rng.integers(0, 255, size, dtype=np.uint8)
            film.append(encoder.encode(pulse, blocks.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)))
        encoded.append(film)
    return encoded


def schedule(gops: int, cuts: int, seed: int) -> list[int]:
    """Choose a camera for every GOP, with exactly `cuts` cuts."""
    rng = np.random.default_rng(seed)
    cut_gops = set(rng.choice(np.arange(1, gops), cuts, replace=False).tolist())
    chosen = [0]
    for gop in range(1, gops):
        step = int(rng.integers(1, _CAMERAS)) if gop in cut_gops else 0
        chosen.append((chosen[-1] + step) % _CAMERAS)
    return chosen


async def check_frames(
    frames: int, cuts: int, *, seed: int = 0, encode: EncodeSettings = _ENCODE
) -> FrameCorrectness:
    """Splice frames, decode a viewer's stream, and compare with the decoded streams of the cameras."""
    encoded = films(frames, seed, encode)
    chosen = schedule(frames // encode.frames_per_gop(_SITE.fps), cuts, seed)
    chunks, fixture = await _watch(encoded, chosen, encode)
    digests = [_digests(film, encode.codec) for film in encoded]
    head = fixture.stream_format.init_segment(_SITE.size, _SITE.fps)
    assert head is not None  # noqa: S101 — keyframes have been spliced
    file = head + b"".join(chunk.data for chunk in chunks)
    has_ts = fixture.stream_format.container == "mp4"
    ts = b"".join(chunk.mpegts for chunk in chunks if isinstance(chunk, MediaChunk)) if has_ts else b""
    expected = [
        digests[camera][gop * encode.frames_per_gop(_SITE.fps) + offset]
        for gop, camera in enumerate(chosen)
        for offset in range(encode.frames_per_gop(_SITE.fps))
    ]
    return FrameCorrectness(
        frames=len(expected),
        cuts=sum(a != b for a, b in pairwise(chosen)),
        in_file=_count_equal(file, "mp4" if has_ts else "matroska", expected),
        in_ts=_count_equal(ts, "mpegts", expected) if has_ts else None,
        ambiguous=sum(len(set(pulse)) < _CAMERAS for pulse in zip(*digests, strict=True)),
    )


async def _watch(
    encoded: Sequence[Sequence[AccessUnit]], chosen: Sequence[int], encode: EncodeSettings
) -> tuple[list[Chunk], SplicerFixture]:
    """Return the stream of one viewer of one object, from the first GOP to the last."""
    names = [f"c{number}" for number in range(_CAMERAS)]
    cameras = [CameraSettings(id=name, source="rtsp://nowhere/") for name in names]
    fixture = SplicerFixture(encoded, Config(site=_SITE, encode=encode, cameras=cameras))
    chunks: list[Chunk] = []
    viewer = None
    for gop, camera in enumerate(chosen):
        fixture.buffer_gop(gop)
        fixture.splicer.publish_decision(fixture.decide(gop, [camera]))
        if viewer is None:
            viewer = fixture.splicer.persons[1].subscribe().chunks()
        chunks.append(await anext(viewer))
    return chunks, fixture


def _digests(film: Sequence[AccessUnit], codec: str) -> list[bytes]:
    """Decode a camera's stream; return a digest of each frame's pixels."""
    decoder = av.CodecContext.create(codec, "r")
    assert isinstance(decoder, av.VideoCodecContext)  # noqa: S101 — narrows the type for mypy
    packets = [*(av.Packet(unit.data) for unit in film), None]
    return [_digest(frame) for packet in packets for frame in decoder.decode(packet)]


def _count_equal(data: bytes, container_format: str, expected: Sequence[bytes]) -> int:
    """Count the frames of a stream that equal the expected ones of their pulses."""
    correct = 0
    with av.open(io.BytesIO(data), "r", format=container_format) as container:
        for frame in container.decode(video=0):
            pulse = round(float(frame.time or 0.0) * _SITE.fps)
            correct += pulse < len(expected) and _digest(frame) == expected[pulse]
    return correct


def _digest(frame: av.VideoFrame) -> bytes:
    return hashlib.blake2b(frame.to_ndarray(format="yuv420p").tobytes(), digest_size=16).digest()
