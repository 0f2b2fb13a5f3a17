"""Cost of a splice per object and frame, compared with decoding and encoding."""

from __future__ import annotations

import statistics
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from typing import cast

import av
import numpy as np
from av.codec.context import Flags

from benchmarks.streaming.simulated_cameras import CAMERAS, ENCODE, GOP, SITE
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.media.codec import stream_format_for
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.streaming.subscriber_queue import Chunk
from server.service.view_selection.decider import GopDecision, ObjectChoice
from server.service.view_selection.explanation import GopExplanation

_NAMES = tuple(f"c{number}" for number in range(CAMERAS))
_NO_REASON = cast("GopExplanation", None)
_US = 1e6


class SplicerFixture:
    """A splicer with frame buffers filled from films, and given decisions."""

    def __init__(self, films: Sequence[Sequence[AccessUnit]], config: Config) -> None:
        self._films, self.gop = films, config.gop
        self.stream_format = stream_format = stream_format_for(
            config.encode.codec, config.site.size, per_camera_parameters=config.encode.parameters == "own"
        )
        self._buffers = {
            name: FrameBuffer(config.site.fps, 4 * self.gop, stream_format) for name in config.camera_ids
        }
        self.splicer = Splicer(self._buffers, stream_format, config)

    def buffer_gop(self, gop: int) -> None:
        """Put a GOP of every camera into the frame buffers; films are looped."""
        for frame_buffer, film in zip(self._buffers.values(), self._films, strict=True):
            for pulse in range(gop * self.gop, (gop + 1) * self.gop):
                unit = film[pulse % len(film)]
                frame_buffer.put(pulse, 1, unit.data, key=unit.key)

    def decide(self, gop: int, cameras: Sequence[int]) -> GopDecision:
        """Return a decision with a camera for each object."""
        names = list(self._buffers)
        choices = tuple(
            ObjectChoice(number, names[camera], None, departed=False)
            for number, camera in enumerate(cameras, start=1)
        )
        return GopDecision(gop * self.gop, self.gop, choices, {}, {}, (), _NO_REASON)


def cif_config() -> Config:
    """Return the configuration of the films' site."""
    cameras = [CameraSettings(id=name, source="rtsp://nowhere/") for name in _NAMES]
    return Config(site=SITE, encode=ENCODE, cameras=cameras)


@dataclass(frozen=True, slots=True)
class SpliceCost:
    """Cost of splicing, processor microseconds; medians over GOPs."""

    objects: int
    buffered: float
    """Buffering a frame of a camera, once for all viewers."""
    spliced: float
    """Splicing a frame of an object."""

    @property
    def buffered_share(self) -> float:
        """Buffering of all cameras, as a share for a frame of an object."""
        return CAMERAS * self.buffered / self.objects


async def splice(films: Sequence[Sequence[AccessUnit]], objects: int, gops: int) -> SpliceCost:
    """Measure splicing with one viewer for every object."""
    fixture, rng = SplicerFixture(films, cif_config()), np.random.default_rng(0)
    buffered, spliced = [], []
    viewers: list[AsyncIterator[Chunk]] = []
    for gop in range(gops + 1):
        decision = fixture.decide(gop, rng.integers(0, CAMERAS, objects).tolist())
        began = time.process_time()
        fixture.buffer_gop(gop)
        between = time.process_time()
        fixture.splicer.publish_decision(decision)
        sizes = [len((await anext(viewer)).data) for viewer in viewers]
        end = time.process_time()
        if gop:  # the first GOP only creates the streams
            assert len(sizes) == objects  # noqa: S101 — every viewer received a chunk
            buffered.append(_US * (between - began) / (CAMERAS * fixture.gop))
            spliced.append(_US * (end - between) / (objects * fixture.gop))
        else:
            viewers = [person.subscribe().chunks() for person in fixture.splicer.persons.values()]
            for viewer in viewers:
                await anext(viewer)
    return SpliceCost(objects, statistics.median(buffered), statistics.median(spliced))


@dataclass(frozen=True, slots=True)
class TranscodeCost:
    """Cost of re-encoding, processor microseconds per frame; medians over GOPs."""

    decoded: float
    encoded: float
    """Includes color conversion to BGR and back, which burning in boxes needs."""

    @property
    def total(self) -> float:
        """Decoding and encoding a frame."""
        return self.decoded + self.encoded


def transcode(film: Sequence[AccessUnit], gops: int) -> TranscodeCost:
    """Decode a film and encode it with the site's encoder."""
    decoder, encoder = av.CodecContext.create("h264", "r"), Encoder(SITE, ENCODE)
    assert isinstance(decoder, av.VideoCodecContext)  # noqa: S101 — narrows the type for mypy
    decoder.thread_count = 1
    decoder.flags |= Flags.low_delay
    decoded, encoded = [], []
    for gop in range(gops + 1):
        first = gop * GOP
        began = time.process_time()
        units = [film[pulse % len(film)] for pulse in range(first, first + GOP)]
        frames = [frame for unit in units for frame in decoder.decode(av.Packet(unit.data))]
        between = time.process_time()
        for pulse, frame in enumerate(frames, start=first):
            encoder.encode(pulse, frame.to_ndarray(format="bgr24").astype(np.uint8, copy=False))
        end = time.process_time()
        if gop:
            decoded.append(_US * (between - began) / GOP)
            encoded.append(_US * (end - between) / GOP)
    return TranscodeCost(statistics.median(decoded), statistics.median(encoded))
