"""The containers that a stream can be sent in: MP4, MPEG-TS, WebM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from server.service.facade.streams import Chunk, MediaChunk
from server.service.service import BestViewService


@dataclass(frozen=True, slots=True)
class Container:
    """How the pieces of a stream are written."""

    content_type: str
    head: Callable[[BestViewService], bytes | None]
    """What a stream begins with; None before the first keyframe."""
    packed: Callable[[Chunk], bytes]
    """Writes one piece."""


def _mp4(piece: Chunk) -> bytes:
    return piece.data_with_audio if isinstance(piece, MediaChunk) else piece.data


def _ts(piece: Chunk) -> bytes:
    return piece.mpegts if isinstance(piece, MediaChunk) else piece.data


MP4 = Container("video/mp4", lambda service: service.streams.init_segment(), _mp4)
TS = Container("video/mp2t", lambda _: b"", _ts)
WEBM = Container("video/webm", lambda service: service.streams.webm_header(), lambda it: it.data)
"""Of a site whose codec is VP8, and of no other."""
