"""What the HTTP interface answers, as frozen structs; fields that a later server adds are passed over."""

from __future__ import annotations

import msgspec


class Site(msgspec.Struct, frozen=True):
    """``/api/site``: what holds for all cameras."""

    name: str
    fps: float
    width: int
    height: int
    gop: int
    """Frames per group of pictures: views are cut at multiples of it."""
    lookahead_frames: int
    """Frames by which the best view is behind the cameras."""
    codec: str | None
    """Of every stream (RFC 6381); None before the first picture."""
    pulse0: float | None
    """When pulse 0 was due (unix seconds); None before the first."""
    now: float
    """The server's clock (unix seconds)."""
    cameras: tuple[str, ...]


class SeenObject(msgspec.Struct, frozen=True):
    """One entry of ``/api/objects``: a person or thing that is or was tracked."""

    object: int
    first_seen: int
    """Pulse number."""
    last_seen: int
    """Pulse number."""
    visible: bool
    camera: str | None
    """The view that is shown of it now; None if there is none."""
    cameras: tuple[str, ...]
    """Who sees it now."""
    thumbnail: str | None
    """A path on the server."""
    also: tuple[int, ...] = ()
    """Other numbers that this person once had; they go on to work."""


class Camera(msgspec.Struct, frozen=True):
    """One entry of ``/api/cameras``."""

    camera: str
    state: str
    """live, gone, ended, starting or refused."""
    pulse: int | None
    """Its last frame."""
    late: int
    """Windows of tracks that came too late to count."""
    fps: float
    message: str


class Choice(msgspec.Struct, frozen=True):
    """``/api/objects/{k}/choice``: why this view."""

    object: int
    first: int
    """Pulse of the first frame decided."""
    frames: int
    camera: str | None
    since: int | None
    """Pulse since which this camera is shown."""
    costs: dict[str, float | None]
    """By camera; None: it cannot be shown."""
    switch_cost: float
    reason: str


class Box(msgspec.Struct, frozen=True, array_like=True):
    """A box in pixels of the site's picture."""

    object: int
    left: float
    top: float
    right: float
    bottom: float


class Cut(msgspec.Struct, frozen=True, rename={"before": "from", "after": "to"}):
    """The view of an object changes at ``pulse``."""

    object: int
    before: str | None
    after: str | None
    pulse: int


class Merged(msgspec.Struct, frozen=True):
    """Two numbers turned out to be one person: ``lost`` is never used again."""

    kept: int
    lost: int


class Split(msgspec.Struct, frozen=True):
    """Whom a camera showed as ``kept`` turned out to be ``parted``, somebody else."""

    kept: int
    parted: int
    camera: str


class Gop(msgspec.Struct, frozen=True):
    """Event ``gop``: what is shown in frames ``first`` to ``first + frames - 1``."""

    first: int
    frames: int
    choices: dict[int, str | None]
    """The camera shown, by object."""
    boxes: dict[str, tuple[tuple[Box, ...], ...]]
    """By camera: for each frame, the boxes in it."""
    cuts: tuple[Cut, ...]
    merged: tuple[Merged, ...] = ()
    """What has turned out about numbers since the GOP before, as ``split``."""
    split: tuple[Split, ...] = ()


class Objects(msgspec.Struct, frozen=True):
    """Event ``objects``, and the answer of ``/api/objects``."""

    objects: tuple[SeenObject, ...]


class Cameras(msgspec.Struct, frozen=True):
    """Event ``cameras``, and the answer of ``/api/cameras``."""

    cameras: tuple[Camera, ...]


Event = Site | Objects | Cameras | Gop
EVENTS: dict[str, type[Event]] = {"site": Site, "objects": Objects, "cameras": Cameras, "gop": Gop}
"""The type of an event's data, by its name."""
