"""The status of a site at one moment."""

from __future__ import annotations

from typing import Annotated

import msgspec

_TIME_MAX = 4102444800.0
"""Unix seconds of the year 2100."""


class CameraNow(msgspec.Struct, frozen=True):
    """One camera. Fields that only ``/metrics`` has are None if the token does not allow to read it."""

    camera: str
    state: str
    """live, gone, ended, starting or refused."""
    message: str
    fps: float
    missed: int
    shed: int
    late: int
    synchronized: bool
    """Whether it follows the pulse server instead of counting by itself."""
    sync_error_s: float | None = None
    """Recent median of a frame's delay after its pulse."""
    tracking_delay_s: float | None = None
    """Recent median of the tracks' delay after their pulse."""
    optimal: float | None = None
    """Share of the windows with a proven optimum, 0 to 1, since the service began."""
    waiting: int | None = None
    """Frames that wait for detection."""
    retry_at: Annotated[float, msgspec.Meta(ge=0.0, le=_TIME_MAX)] | None = None
    """When its source, which cannot be used, is opened again, unix seconds."""


class PersonNow(msgspec.Struct, frozen=True):
    """One person."""

    object: int
    name: str | None
    visible: bool
    camera: str | None
    """The camera that shows them."""
    since_s: float | None
    """Seconds of video since that camera was chosen; None: not requested, or unknown."""
    cameras: tuple[str, ...]
    """The cameras that see them."""


class ServiceNow(msgspec.Struct, frozen=True):
    """The best-view service, from ``/metrics``."""

    began: float
    """Unix seconds; it differs for each run."""
    viewers: dict[str, int]
    """By kind of stream."""
    recording: bool
    recorded_bytes: int
    decided_pulse: int
    delay_s: float | None
    """Mean delay from a GOP's first pulse to its sending, since the service began; None before the first."""
    lag_s: float | None
    """Mean lag of its event loop."""
    waiting: dict[str, int]
    """Queue lengths, by queue."""
    sent_bytes: int
    """Sent over HTTP since it began."""
    cpu_s: float
    """Processor seconds since it began."""
    memory_bytes: int


class SiteNow(msgspec.Struct, frozen=True):
    """A whole site."""

    name: str
    now: float
    """The server's clock, unix seconds."""
    ready: bool
    """Whether a best view can be served."""
    why: str
    """In one line: why it cannot, or the number of cameras."""
    pulse: int | None
    """The newest pulse; None if unknown, or before the first."""
    cameras: tuple[CameraNow, ...]
    people: tuple[PersonNow, ...]
    service: ServiceNow | None
    """None if the token does not allow to read ``/metrics``."""
