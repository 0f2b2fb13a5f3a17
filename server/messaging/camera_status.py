"""A camera's status: whether it delivers frames, and what is wrong with its picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
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

CameraState = Literal["starting", "live", "away", "ended"]
"""State of a camera; away: its source delivers no frames now."""


SubstreamState = Literal["none", "live", "away"]
"""State of the stream in which people are tracked.

none: the camera has only its source; away: it delivers no pictures of the right time.
"""
SUBSTREAM_AWAY = "its substream delivers no pictures: people are tracked in its source"
"""The text for people."""


class PictureMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Where a picture lies since its camera was knocked: moved, enlarged and turned at its center."""

    x: Coordinate
    """Pixels of the site's image."""
    y: Coordinate
    grow: Annotated[float, msgspec.Meta(ge=-0.5, le=0.5)]
    """The scale less 1."""
    turn: Annotated[float, msgspec.Meta(ge=-0.5, le=0.5)]
    """Sine of the angle, clockwise."""


def motion_text(motion: PictureMotion) -> str:
    """Return a motion in words."""
    degrees = abs(math.degrees(math.asin(motion.turn)))
    return f"it has moved by {math.hypot(motion.x, motion.y):.0f} pixels and {degrees:.1f} degrees"


class CameraStatus(msgspec.Struct, frozen=True, kw_only=True):
    """Status of a camera, once a second."""

    camera: str
    boot: Number
    state: CameraState
    pulse: Annotated[int, msgspec.Meta(ge=-1, le=PULSE_MAX)]
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
