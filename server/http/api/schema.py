"""What the API answers. ``/api/openapi.json`` is made from these."""

from __future__ import annotations

import msgspec

from server.service.facade.assist import Flag
from server.service.facade.cameras import CameraInfo


class SiteInfo(msgspec.Struct, frozen=True):
    """The site, and how pulse numbers map to time."""

    name: str
    fps: float
    width: int
    height: int
    gop: int
    lookahead_frames: int
    codec: str | None
    """RFC 6381 codec string of every stream; null before the first key frame."""
    container: str
    """What streams are in: mp4, or webm where the codec is vp8; best.mp4 or best.webm by that."""
    sound: str | None
    """The same of the sound beside the pictures; null: this site has none."""
    pulse0: float | None
    """When pulse 0 was due: unix seconds by the server's clock."""
    now: float
    """The server's clock, unix seconds."""
    cameras: list[str]


class ObjectInfo(msgspec.Struct, frozen=True):
    """One person."""

    object: int
    name: str | None
    """What the operator calls them."""
    aliases: list[int]
    """Other numbers that this person once had; they go on to work."""
    first_seen: int
    """Pulse."""
    last_seen: int
    """Pulse."""
    visible: bool
    """Some camera sees the person now."""
    camera: str | None
    """The camera that shows the person now."""
    cameras: list[str]
    """The cameras that see the person now."""
    thumbnail: str | None
    """Where a small picture is; the address changes with the picture."""


class Elsewhere(msgspec.Struct, frozen=True):
    """One person whom another best-view service of the site decides for."""

    object: int
    server: str | None
    """Its base URL; null where the configuration does not say."""


class Objects(msgspec.Struct, frozen=True):
    """Everybody who is known."""

    objects: list[ObjectInfo]
    elsewhere: list[Elsewhere]
    """Whom other services of the site show; empty where there are none."""


class Cameras(msgspec.Struct, frozen=True):
    """All cameras of the site."""

    cameras: list[CameraInfo]


class PastSpan(msgspec.Struct, frozen=True):
    """Frames without a hole."""

    first: int
    """Pulse."""
    frames: int
    begins: str | None
    """When that was: UTC, ISO 8601; null before the first pulse."""
    ends: str | None


class PastView(msgspec.Struct, frozen=True):
    """Frames of one camera."""

    camera: str
    first: int
    """Pulse."""
    frames: int


class Past(msgspec.Struct, frozen=True):
    """What can be seen again."""

    spans: list[PastSpan]
    views: list[PastView]
    """By which camera, in order."""


class FlagList(msgspec.Struct, frozen=True):
    """What an operator is asked to look at."""

    flags: list[Flag]
    """Those that can be answered, the most urgent first, and then those that are over, the newest first."""
