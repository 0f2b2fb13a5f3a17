"""What a stream can be sent as: one set of pictures and sound, several containers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from server.service.service import BestViewService
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Chunk


@dataclass(frozen=True, slots=True)
class Form:
    """A container."""

    content_type: str
    head: Callable[[BestViewService], bytes | None]
    """What a stream begins with; None: nobody knows yet."""
    packed: Callable[[Chunk], bytes]
    """Gives a piece of a stream."""


def mp4_head(service: BestViewService) -> bytes | None:
    """Give what every MP4 of a site begins with, the same for all; None before the first key frame."""
    return service.agreement.head(
        service.config.site.size, service.config.site.fps, service.config.sound.format
    )


def _mp4(piece: Chunk) -> bytes:
    return piece.data_with_audio if isinstance(piece, MediaChunk) else piece.data


def _ts(piece: Chunk) -> bytes:
    return piece.mpegts if isinstance(piece, MediaChunk) else piece.data


MP4 = Form("video/mp4", mp4_head, _mp4)
TS = Form("video/mp2t", lambda _: b"", _ts)
WEBM = Form(
    "video/webm",
    lambda service: service.agreement.head(service.config.site.size, service.config.site.fps),
    lambda it: it.data,
)
"""Of a site whose codec is VP8, and of no other."""
