"""A camera's status: whether it delivers frames, and what is wrong with its picture."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec

from server.messaging.number_types import PULSE_MAX, Coordinate, Duration, Number, Time
from tracking.types import PictureCondition

CONDITION_TEXTS: Mapping[PictureCondition, str] = {
    "clear": "the picture is clear",
    "covered": "the lens is covered: something plain hides much of what it saw, or there is no light",
    "turned": "the camera is turned away: it shows another scene than before",
    "blurred": "the picture is blurred: out of focus, or a film on the lens",
    "noisy": "the picture is dark: its noise is as strong as what it shows",
    "frozen": "the picture is frozen: it has not changed at all",
}
"""By condition: a text for people, its summary before the colon."""


def picture_text(condition: PictureCondition, covered_share: float) -> str:
    """Return what is wrong with a picture in words, also if the rest of a partly covered one is clear."""
    if condition != "clear" or covered_share == 0.0:
        return CONDITION_TEXTS[condition]
    share = f"{100.0 * covered_share:.0f} % of the picture is covered"
    return f"{share}: something is on the lens or close before it; people are tracked in the rest"


CameraState = Literal["starting", "live", "away", "ended"]
"""State of a camera; away: its source delivers no frames now."""


SubstreamState = Literal["none", "live", "away"]
"""State of the stream in which people are tracked.

none: the camera has only its source; away: it delivers no pictures of the right time.
"""
SUBSTREAM_AWAY = "its substream delivers no pictures: people are tracked in its source"
"""The text for people."""


Row = tuple[Coordinate, Coordinate, Coordinate]


class PictureMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Where a picture lies since its camera was knocked or turned."""

    matrix: tuple[Row, Row, Row]
    """Homography from the site's image before to that of now, pixels."""
    pixels: Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
    """How far the middle of the picture has moved."""
    degrees: Annotated[float, msgspec.Meta(ge=0.0, le=180.0)]
    """By how much it is turned there."""

    def __post_init__(self) -> None:
        (a, b, c), (d, e, f), (g, h, i) = self.matrix
        if not abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) > _LEAST_DETERMINANT:
            raise ValueError("a motion is a homography that can be inverted")


_LEAST_DETERMINANT = 1e-6


def motion_text(motion: PictureMotion) -> str:
    """Return a motion in words."""
    return f"it has moved by {motion.pixels:.0f} pixels and {motion.degrees:.1f} degrees"


REASON_MAX = 1000
"""Characters of a reason, at most."""


RetryCause = Literal["unopened", "changed", "lost"]
"""Why a source is opened again: it could not be, what it sends has changed, or it has stopped sending."""


class UnavailableCamera(msgspec.Struct, frozen=True, kw_only=True):
    """Why a camera's process cannot use its source; it opens it again."""

    reason: Annotated[str, msgspec.Meta(max_length=REASON_MAX)]
    """In a line for people, without passwords."""
    cause: RetryCause = "unopened"
    retry_s: Duration = 0.0
    """Seconds until it is opened again."""
    address: Annotated[str, msgspec.Meta(max_length=REASON_MAX)] = ""
    """Protocol and host of the source, for operators; empty: unknown, or the reason may name it."""


@dataclass(frozen=True, slots=True)
class RetryPause:
    """Why a source cannot be used, and until when its camera waits before it opens it again."""

    reason: str
    cause: RetryCause
    until: float
    """On the monotonic clock."""
    address: str = ""
    """As in UnavailableCamera."""

    def message(self) -> UnavailableCamera:
        """Return the message that tells services what is left of the pause."""
        return UnavailableCamera(
            reason=" ".join(self.reason.split())[:REASON_MAX],
            cause=self.cause,
            retry_s=max(0.0, self.until - time.monotonic()),
            address=self.address[:REASON_MAX],
        )


class CameraStatus(msgspec.Struct, frozen=True, kw_only=True):
    """Status of a camera, once a second."""

    camera: str
    boot: Number
    state: CameraState
    pulse: Annotated[int, msgspec.Meta(ge=-1, le=PULSE_MAX)]
    unavailable: UnavailableCamera | None = None
    """Why its source is away, and when it is connected again; null: it is there, or nothing is known yet."""
    fps: Duration
    """Frames captured in about the last second."""
    missed: Number
    """Pulses without a frame since the start."""
    shed: Number
    """Frames without detection since the start."""
    waiting: Number = 0
    """Frames that are queued for detection."""
    condition: PictureCondition = "clear"
    """What is wrong with the picture."""
    condition_since: Time = 0.0
    """When that began, unix seconds by the camera's clock; 0: nothing is wrong."""
    covered_share: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.0
    """The share of the picture that something on the lens hides, also if the rest is clear."""
    substream: SubstreamState = "none"
    """Whether people are tracked in a substream."""
    motion: PictureMotion | None = None
    """How the picture has moved; null: not noticeably."""
    motion_since: Time = 0.0
    """Since when, unix seconds by the camera's clock."""
    load_level: Annotated[int, msgspec.Meta(ge=0, le=100)] = 0
    """Load-shedding level; 0: none."""
    load: Annotated[str, msgspec.Meta(max_length=200, pattern=r"^[ -~]*\Z")] = ""
    """The shed work as text for people: printable ASCII."""
    position_corrections: Number = 0
    """Position corrections that the tracker received since the start."""
    bad_messages: Number = 0
    """Invalid messages that the camera received since the start."""
    synchronized: bool
    """Pulses come from the server; otherwise the camera counts by itself."""
    clock_offset: Time
    """Server's clock minus the camera's, seconds."""
    round_trip: Time
