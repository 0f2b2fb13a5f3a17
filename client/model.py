"""What the HTTP interface answers, as frozen structs; fields that a later server adds are passed over."""

from __future__ import annotations

from typing import Annotated

import msgspec

Moment = Annotated[float, msgspec.Meta(ge=0, le=1e11)]
"""Unix seconds that a calendar has."""


class Site(msgspec.Struct, frozen=True):
    """``/api/site``: what holds for all cameras."""

    name: str
    fps: Annotated[float, msgspec.Meta(gt=0)]
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
    now: Moment
    """The server's clock (unix seconds)."""
    cameras: tuple[str, ...]
    container: str = "mp4"
    """What streams are in: mp4, or webm where the codec is vp8."""
    sound: str | None = None
    """The codec of the sound beside the pictures; None: the site has none."""


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
    aliases: tuple[int, ...] = ()
    """Other numbers that this person once had; they go on to work."""
    name: str | None = None
    """What the operator calls them."""


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
    """What a cut costs, in frames of not seeing the object."""
    reason: str
    seen: dict[str, float] = {}
    """By camera: the share of the look-ahead in which it sees the object."""
    quality: dict[str, float | None] = {}
    """By camera: how well it shows the object, 0 to 1; None: it does not see it."""
    terms: dict[str, dict[str, float]] = {}
    """By camera: what the quality is made of, 0 to 1 each."""
    undetected: dict[str, float] = {}
    """By camera: the share of the look-ahead in which it does not find the object, which stands before it as
    others know."""
    undetected_quality: dict[str, float | None] = {}
    """By camera: what such a view is taken to be worth, 0 to 1; None: there is none."""
    weights: dict[str, float] = {}
    """By term: the share of a view's worth that is lost where the term is 0."""
    before: str | None = None
    """The camera of the GOP before."""
    stay: float | None = None
    """What the look-ahead costs with that camera, in the unit of `switch_cost`; None: it cannot be shown."""
    cut: float | None = None
    """What it costs with the best other camera, the cut included; None: there is none."""
    cut_to: str | None = None


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
    """Whom a camera showed as ``kept`` turned out to be ``new_object``, somebody else."""

    kept: int
    new_object: int
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


class Flag(msgspec.Struct, frozen=True):
    """Event ``flag``: what an operator is asked to look at, as it is now."""

    id: int
    objects: tuple[int, ...]
    """Whom it is about."""
    cameras: tuple[str, ...]
    """Where it is foreseen."""
    reason: str
    """crossing, id_switch, track_loss or optimality_gap."""
    pulse: int
    """When it is expected."""
    raised: int
    """The newest pulse when it was raised."""
    margin: float
    """How sure the tracker is, as a cost: 0 is undecided."""
    state: str
    """raised, followed, answered or expired."""


class Span(msgspec.Struct, frozen=True):
    """Frames that can be seen again."""

    first: int
    frames: int
    begins: str | None
    """When that was (ISO 8601, UTC); None before the first pulse."""
    ends: str | None


class Past(msgspec.Struct, frozen=True):
    """``/api/objects/{k}/past``: what can be seen again."""

    spans: tuple[Span, ...]


class Objects(msgspec.Struct, frozen=True):
    """Event ``objects``, and the answer of ``/api/objects``."""

    objects: tuple[SeenObject, ...]


class Cameras(msgspec.Struct, frozen=True):
    """Event ``cameras``, and the answer of ``/api/cameras``."""

    cameras: tuple[Camera, ...]


Event = Site | Objects | Cameras | Gop | Flag
EVENTS: dict[str, type[Event]] = {
    "site": Site,
    "objects": Objects,
    "cameras": Cameras,
    "gop": Gop,
    "flag": Flag,
}
"""The type of an event's data, by its name."""
