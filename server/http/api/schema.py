"""Schemas of the API's answers, also the source of ``/api/openapi.json``."""

from __future__ import annotations

import msgspec

from server.config.sections.access import Blur
from server.service.facade.assist import Flag
from server.service.facade.cameras import CameraInfo
from server.service.facade.people import PersonElsewhere
from server.service.facade.streams import ViewerDelay


class SiteInfo(msgspec.Struct, frozen=True):
    """The site, and how pulse numbers map to time."""

    name: str
    fps: float
    width: int
    height: int
    gop: int
    lookahead_s: float
    codec: str | None
    """RFC 6381 codec string of every stream; null before the first keyframe."""
    container: str
    """Container of the streams: mp4, or webm if the codec is vp8."""
    h264: str | None
    """Codec string of best.mp4?codec=h264; null: the streams are H.264 themselves."""
    sound: str | None
    """RFC 6381 codec string of the sound; null: the site has no sound."""
    pulse0: float | None
    """Unix time at which pulse 0 was due, by the server's clock."""
    now: float
    """Unix time by the server's clock."""
    cameras: list[str]
    others: list[str]
    """Base URLs of the services that replace this one when it does not answer."""
    blur: Blur | None
    """Whom the caller sees pixelated: others than the person of the stream, or everybody; null: nobody."""


class Delays(msgspec.Struct, frozen=True):
    """The delays that viewers may choose, shortest first."""

    delays: list[ViewerDelay]


class ObjectInfo(msgspec.Struct, frozen=True):
    """One person."""

    object: int
    name: str | None
    """The name entered by an operator."""
    aliases: list[int]
    """Former numbers of this person, which remain valid."""
    first_seen: int
    """Pulse."""
    last_seen: int
    """Pulse."""
    visible: bool
    """Whether a camera sees the person now."""
    camera: str | None
    """The camera that shows the person now."""
    cameras: list[str]
    """The cameras that see the person now."""
    thumbnail: str | None
    """URL of a thumbnail; it changes with the picture."""


class Objects(msgspec.Struct, frozen=True):
    """All known people."""

    objects: list[ObjectInfo]
    elsewhere: list[PersonElsewhere]
    """People of the site's other services, and of other sites that accept the viewer."""


class Cameras(msgspec.Struct, frozen=True):
    """All cameras of the site."""

    cameras: list[CameraInfo]


class PastSpan(msgspec.Struct, frozen=True):
    """Consecutive recorded frames."""

    first: int
    """Pulse."""
    frames: int
    begins: str | None
    """UTC, ISO 8601; null before the first pulse."""
    ends: str | None


class PastView(msgspec.Struct, frozen=True):
    """Frames of one camera."""

    camera: str
    first: int
    """Pulse."""
    frames: int


class Past(msgspec.Struct, frozen=True):
    """Recorded spans of a stream."""

    spans: list[PastSpan]
    views: list[PastView]
    """The cameras shown, in chronological order."""


class FlagList(msgspec.Struct, frozen=True):
    """Flags: predicted identity failures."""

    flags: list[Flag]
    """Open ones first, the most urgent first; then ended ones, the newest first."""
