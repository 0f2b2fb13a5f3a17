"""Parts of a best view's stream in any container: an init segment, then fragments."""

from __future__ import annotations

from dataclasses import dataclass


class MediaStreamError(ValueError):
    """The bytes are not a stream of the expected container."""


class FormatChangedError(MediaStreamError):
    """The server's stream has another format than the recording began with."""


@dataclass(frozen=True, slots=True)
class InitSegment:
    """Data that a player needs before the first fragment (MP4: ``ftyp`` and ``moov``)."""

    data: bytes
    timescale: int
    """Ticks a second of the fragments' ``time``."""


@dataclass(frozen=True, slots=True)
class Fragment:
    """A unit of media that a player can append: a picture, or some sound."""

    data: bytes
    time: int
    """Media time of its first frame, in ticks of its track."""
    is_sound: bool = False
