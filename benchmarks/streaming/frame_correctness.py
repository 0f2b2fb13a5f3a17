"""Check that every frame of a stream is the selected camera's, to the pixel, in every container format."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import av
import numpy as np

from benchmarks.streaming.splice_cost import SplicerFixture
from server.camera.encoding.encoder import AccessUnit, Encoder
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
    contained: int
    """Correct frames in the MP4, or in VP8's WebM."""
    ts: int | None
    """Correct frames in the transport stream; VP8 has none."""
    alike: int
    """Pulses at which two cameras have equal frames, so that a wrong one would go unnoticed."""

    @property
    def all_right(self) -> bool:
        """Whether every frame is correct, and a wrong one would have been noticed."""
        ts = self.frames if self.ts is None else self.ts
        return self.contained == ts == self.frames and not self.alike


def films(frames: int, seed: int, encode: EncodeSettings = _ENCODE) -> list[list[AccessUnit]]:
    """Encode pictures of random colors for each camera, all different."""
    rng, made = np.random.default_rng(seed), []
    for _ in range(_CAMERAS):
        encoder = Encoder(_SITE, encode)
        film = []
        for pulse in range(frames):
            size = (_SITE.height // _BLOCK, _SITE.width // _BLOCK, 3)
            blocks = rng.integers(0, 255, size, dtype=np.uint8)
            film.append(encoder.encode(pulse, blocks.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)))
        made.append(film)
    return made


def schedule(gops: int, cuts: int, seed: int) -> list[int]:
    """Choose a camera for every GOP, with exactly `cuts` cuts."""
    rng = np.random.default_rng(seed)
    at = set(rng.choice(np.arange(1, gops), cuts, replace=False).tolist())
    chosen = [0]
    for gop in range(1, gops):
        step = int(rng.integers(1, _CAMERAS)) if gop in at else 0
        chosen.append((chosen[-1] + step) % _CAMERAS)
    return chosen


async def judge(
    frames: int, cuts: int, *, seed: int = 0, encode: EncodeSettings = _ENCODE
) -> FrameCorrectness:
    """Splice frames, decode a viewer's stream, and compare with each camera's own decode."""
    made = films(frames, seed, encode)
    chosen = schedule(frames // encode.gop, cuts, seed)
    pieces, cut = await _watch(made, chosen, encode)
    own = [_own(film, encode.codec) for film in made]
    head = cut.stream_format.init_segment(_SITE.size, _SITE.fps)
    assert head is not None  # noqa: S101 — keyframes have been spliced
    contained = head + b"".join(piece.data for piece in pieces)
    has_ts = cut.stream_format.container == "mp4"
    ts = b"".join(piece.mpegts for piece in pieces if isinstance(piece, MediaChunk)) if has_ts else b""
    expected = [
        own[camera][gop * encode.gop + n] for gop, camera in enumerate(chosen) for n in range(encode.gop)
    ]
    return FrameCorrectness(
        frames=len(expected),
        cuts=sum(a != b for a, b in pairwise(chosen)),
        contained=_equal(contained, "mp4" if has_ts else "matroska", expected),
        ts=_equal(ts, "mpegts", expected) if has_ts else None,
        alike=sum(len(set(pulse)) < _CAMERAS for pulse in zip(*own, strict=True)),
    )


async def _watch(
    made: Sequence[Sequence[AccessUnit]], chosen: Sequence[int], encode: EncodeSettings
) -> tuple[list[Chunk], SplicerFixture]:
    """Return the stream of one viewer of one object, from the first GOP to the last."""
    names = [f"c{number}" for number in range(_CAMERAS)]
    cameras = [CameraSettings(id=name, source="rtsp://nowhere/") for name in names]
    cut = SplicerFixture(made, Config(site=_SITE, encode=encode, cameras=cameras))
    pieces: list[Chunk] = []
    viewer = None
    for gop, camera in enumerate(chosen):
        cut.shelve(gop)
        cut.splicer.publish_decision(cut.decide(gop, [camera]))
        if viewer is None:
            viewer = cut.splicer.persons[1].subscribe().chunks()
        pieces.append(await anext(viewer))
    return pieces, cut


def _own(film: Sequence[AccessUnit], codec: str) -> list[bytes]:
    """Decode a camera's own stream; return a digest of each frame's pixels."""
    decoder = av.CodecContext.create(codec, "r")
    assert isinstance(decoder, av.VideoCodecContext)  # noqa: S101 — tells mypy what it is
    packets = [*(av.Packet(unit.data) for unit in film), None]
    return [_digest(frame) for packet in packets for frame in decoder.decode(packet)]


def _equal(data: bytes, form: str, expected: Sequence[bytes]) -> int:
    """Count the frames of a stream that equal the expected ones of their pulses."""
    right = 0
    with av.open(io.BytesIO(data), "r", format=form) as container:
        for frame in container.decode(video=0):
            pulse = round(float(frame.time or 0.0) * _SITE.fps)
            right += pulse < len(expected) and _digest(frame) == expected[pulse]
    return right


def _digest(frame: av.VideoFrame) -> bytes:
    return hashlib.blake2b(frame.to_ndarray(format="yuv420p").tobytes(), digest_size=16).digest()
