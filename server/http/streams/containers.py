"""Containers for streams: MP4, MPEG-TS and WebM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from server.service.facade.streams import Chunk, MediaChunk
from server.service.service import BestViewService


@dataclass(frozen=True, slots=True)
class Container:
    """How a stream is written."""

    content_type: str
    head: Callable[[BestViewService], bytes | None]
    """Returns the bytes at the start of a stream; None before the first keyframe."""
    packed: Callable[[Chunk], bytes]
    """Returns the bytes of a chunk."""


def _mp4(chunk: Chunk) -> bytes:
    return chunk.data_with_audio if isinstance(chunk, MediaChunk) else chunk.data


def _ts(chunk: Chunk) -> bytes:
    return chunk.mpegts if isinstance(chunk, MediaChunk) else chunk.data


MP4 = Container("video/mp4", lambda service: service.streams.init_segment(), _mp4)
TS = Container("video/mp2t", lambda _: b"", _ts)
WEBM = Container("video/webm", lambda service: service.streams.webm_header(), lambda chunk: chunk.data)
"""Only for sites whose codec is VP8."""
