"""What the API answers. ``/api/openapi.json`` is made from these."""

from __future__ import annotations

import msgspec

from server.service.operator_assist.flags import Flag


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
    also: list[int]
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


class CameraInfo(msgspec.Struct, frozen=True):
    """One camera."""

    camera: str
    state: str
    """starting, live, gone, ended or refused."""
    pulse: int
    """The newest frame."""
    late: int
    """Epochs whose tracks came too late."""
    fps: float
    missed: int
    shed: int
    load_level: int
    """How much is left out because the machine has too much to do; 0: nothing."""
    in_step: bool
    """Pulses come from the server; otherwise the camera goes on at its own rate."""
    message: str


class Cameras(msgspec.Struct, frozen=True):
    """All cameras of the site."""

    cameras: list[CameraInfo]


class Choice(msgspec.Struct, frozen=True):
    """Why this view."""

    object: int
    first: int
    """First pulse of the newest decided GOP."""
    frames: int
    camera: str | None
    since: int
    """Pulse of the last cut."""
    costs: dict[str, float | None]
    """Mean cost a frame of each camera over the look-ahead; null: cannot be shown."""
    seen: dict[str, float]
    """Share of the look-ahead in which each camera sees the person."""
    quality: dict[str, float | None]
    """How well each camera shows the person where it sees them, 0 to 1; null: it does not."""
    terms: dict[str, dict[str, float]]
    """By camera: the terms of that quality, likewise; empty where it does not see the person."""
    unfound: dict[str, float]
    """Share of the look-ahead in which each camera does not find the person, who stands before it as the
    others know."""
    unfound_quality: dict[str, float | None]
    """What such a view is taken to be worth: quality, times how surely they show; null: there is none."""
    weights: dict[str, float]
    """By term: the share of a view's worth that is lost where the term is 0."""
    before: str | None
    """The camera of the GOP before; null: there was none."""
    lookahead: int
    """Frames from `first` on that were looked at."""
    switch_cost: float
    """What a cut costs, in frames of not seeing the person."""
    stay: float | None
    """What the look-ahead costs with `before`, likewise; null: there is none, or it cannot be shown."""
    cut: float | None
    """What it costs with the best other camera, the cut included; null: there is none."""
    cut_to: str | None
    """That camera."""
    reason: str


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


class SessionInfo(msgspec.Struct, frozen=True):
    """What somebody may."""

    by_token: bool
    """By a token; else anybody may watch, and who is at the server's own machine may operate."""
    name: str | None
    """Of the token; null: there are none."""
    role: str
    """watch or operate."""
    object: int | None
    """This person's views alone; null: everybody's."""
    camera: str | None
    """This camera alone; null: all."""


class Problem(msgspec.Struct, frozen=True):
    """Why there is no answer."""

    error: str
