"""The responses and events of the HTTP interface; fields that a later server adds are ignored."""

from __future__ import annotations

from typing import Annotated

import msgspec

Moment = Annotated[float, msgspec.Meta(ge=0, le=1e11)]
"""Unix seconds within the range of a calendar."""


class Site(msgspec.Struct, frozen=True):
    """``/api/site``: the properties that all cameras share."""

    name: str
    fps: Annotated[float, msgspec.Meta(gt=0)]
    width: int
    height: int
    gop: int
    """Frames per group of pictures: views are cut at multiples of it."""
    lookahead_s: float
    """Frames by which the best view lags behind the cameras."""
    codec: str | None
    """Codec string of every stream (RFC 6381); None before the first picture."""
    pulse0: float | None
    """When pulse 0 was due (unix seconds); None before the first."""
    now: Moment
    """The server's clock (unix seconds)."""
    cameras: tuple[str, ...]
    container: str = "mp4"
    """Container of the streams: mp4, or webm if the codec is vp8."""
    h264: str | None = None
    """Codec string of best.mp4?codec=h264; None: the streams are H.264 themselves."""
    sound: str | None = None
    """Audio codec; None: the site has no sound."""
    others: tuple[str, ...] = ()
    """Base URLs of the services that replace this one when it does not answer."""


class SeenObject(msgspec.Struct, frozen=True):
    """One entry of ``/api/objects``: a person or thing that is or was tracked."""

    object: int
    first_seen: int
    """Pulse number."""
    last_seen: int
    """Pulse number."""
    visible: bool
    camera: str | None
    """The camera that shows it now; None if none does."""
    cameras: tuple[str, ...]
    """The cameras that see it now."""
    thumbnail: str | None
    """A path on the server."""
    aliases: tuple[int, ...] = ()
    """Earlier numbers of this person, which remain valid."""
    name: str | None = None
    """The name that an operator gave."""


class Camera(msgspec.Struct, frozen=True):
    """One entry of ``/api/cameras``."""

    camera: str
    state: str
    """live, gone, ended, starting or refused."""
    pulse: int | None
    """Pulse of its last frame."""
    late: int
    """Windows of tracks that came too late to be used."""
    fps: float
    message: str
    retry_at: float | None = None
    """When its source, which cannot be used, is opened again, unix seconds."""
    condition: str = "clear"
    """What is wrong with the picture: covered, turned, blurred, noisy or frozen."""
    condition_since: float | None = None
    """When that began, unix seconds."""
    covered_share: float = 0.0
    """The share of the picture that something on the lens hides, also if the rest is clear."""


class Choice(msgspec.Struct, frozen=True):
    """``/api/objects/{k}/choice``: why this view."""

    object: int
    first: int
    """Pulse of the first frame decided."""
    frames: int
    camera: str | None
    since: int | None
    """Pulse from which on this camera is shown."""
    costs: dict[str, float | None]
    """By camera; None: it cannot be shown."""
    switch_cost_s: float
    """Cost of a cut, in seconds of not seeing the object."""
    reason: str
    seen: dict[str, float] = {}
    """By camera: the share of the look-ahead in which it sees the object."""
    quality: dict[str, float | None] = {}
    """By camera: how well it shows the object, 0 to 1; None: it does not see it."""
    terms: dict[str, dict[str, float]] = {}
    """By camera: the terms of the quality, 0 to 1 each."""
    undetected: dict[str, float] = {}
    """By camera: the share of the look-ahead in which it does not detect the object, although by the other
    cameras' detections the object is in its picture."""
    undetected_quality: dict[str, float | None] = {}
    """By camera: the quality assumed for such a view, 0 to 1; None: no such view."""
    weights: dict[str, float] = {}
    """By term: the share of a view's quality that is lost if the term is 0."""
    before: str | None = None
    """The camera of the previous GOP."""
    stay_s: float | None = None
    """Cost of the look-ahead with that camera, in seconds as `switch_cost_s`; None: it cannot be shown."""
    cut_s: float | None = None
    """Cost with the best other camera, the cut included; None: there is no other."""
    cut_to: str | None = None


class Delay(msgspec.Struct, frozen=True):
    """A delay that viewers may choose, as measured in the last minutes; None: not measured yet."""

    delay: str
    """live, balanced or smooth."""
    lookahead_s: float
    """Seconds of look-ahead of its view selection."""
    delay_s: float | None = None
    """Median of the seconds from when a frame was due until it is sent."""
    delay_p95_s: float | None = None
    """The 95th percentile of that."""
    regret_s: float | None = None
    """Cost beyond the best views in hindsight: seconds of not seeing the object, per minute."""
    cuts_per_minute: float | None = None


class Delays(msgspec.Struct, frozen=True):
    """All delays, shortest first."""

    delays: tuple[Delay, ...]


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
    """The person whom a camera tracked as ``kept`` turned out to be another, ``new_object``."""

    kept: int
    new_object: int
    camera: str


class Gop(msgspec.Struct, frozen=True):
    """Event ``gop``: the views of frames ``first`` to ``first + frames - 1``."""

    first: int
    frames: int
    choices: dict[int, str | None]
    """The camera shown, by object."""
    boxes: dict[str, tuple[tuple[Box, ...], ...]]
    """By camera: for each frame, the boxes in it."""
    cuts: tuple[Cut, ...]
    merged: tuple[Merged, ...] = ()
    """Corrections of object numbers since the previous GOP, as ``split``."""
    split: tuple[Split, ...] = ()


class Flag(msgspec.Struct, frozen=True):
    """Event ``flag``: a risk that an operator should look at, in its present state."""

    id: int
    objects: tuple[int, ...]
    """The objects concerned."""
    cameras: tuple[str, ...]
    """The cameras in which it is expected."""
    reason: str
    """crossing, id_switch, track_loss or optimality_gap."""
    pulse: int
    """When it is expected."""
    raised: int
    """The newest pulse when it was raised."""
    margin: float
    """The tracker's certainty, as a cost: 0 is undecided."""
    state: str
    """raised, followed, answered or expired."""


class Span(msgspec.Struct, frozen=True):
    """Recorded frames."""

    first: int
    frames: int
    begins: str | None
    """ISO 8601, UTC; None before the first pulse."""
    ends: str | None


class Past(msgspec.Struct, frozen=True):
    """``/api/objects/{k}/past``: what is recorded of an object."""

    spans: tuple[Span, ...]


class PersonElsewhere(msgspec.Struct, frozen=True):
    """Somebody whom another service of the site serves, or whom another site has seen last."""

    object: int
    server: str | None
    """Its address; None if the server does not know it."""
    site: str | None = None
    """The other site's name; None: it is of this one."""
    visible: bool | None = None
    """Whether the other site or area sees them now; None: a service that all cameras send to."""
    token: bool = False
    """Whether it is another site that requires a token, and accepts the client's."""


class Objects(msgspec.Struct, frozen=True):
    """Event ``objects``, and the response of ``/api/objects``."""

    objects: tuple[SeenObject, ...]
    elsewhere: tuple[PersonElsewhere, ...] = ()
    """People of other services and sites."""


class Cameras(msgspec.Struct, frozen=True):
    """Event ``cameras``, and the response of ``/api/cameras``."""

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
