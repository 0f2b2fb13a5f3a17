"""How a site is at one moment, as frozen structs."""

from __future__ import annotations

import msgspec


class CameraNow(msgspec.Struct, frozen=True):
    """One camera. What only ``/metrics`` says is None where that may not be read."""

    camera: str
    state: str
    """live, gone, ended, starting or refused."""
    message: str
    fps: float
    missed: int
    shed: int
    late: int
    synchronized: bool
    """It follows the pulse server, and does not count by itself."""
    sync_error_s: float | None = None
    """Median: how long after its pulse a frame was taken lately."""
    tracking_delay_s: float | None = None
    """Median: how long after their pulse tracks were there lately."""
    certified: float | None = None
    """Share of the windows whose answer is proven to be the best, 0 to 1, since the service began."""
    waiting: int | None = None
    """Frames that wait to be searched."""


class PersonNow(msgspec.Struct, frozen=True):
    """One person."""

    object: int
    name: str | None
    visible: bool
    camera: str | None
    """Who shows them."""
    since_s: float | None
    """For how long already, in seconds of video; None: not asked, or not known."""
    cameras: tuple[str, ...]
    """Who sees them."""


class ServiceNow(msgspec.Struct, frozen=True):
    """The best-view service: what ``/metrics`` says of it."""

    began: float
    """Unix seconds; another value is another run."""
    viewers: dict[str, int]
    """By kind."""
    recording: bool
    recorded_bytes: int
    decided_pulse: int
    delay_s: float | None
    """Mean from a GOP's first pulse to its being sent, since the service began; None: none was."""
    lag_s: float | None
    """Mean that its event loop is late by."""
    waiting: dict[str, int]
    """What waits, by queue."""
    sent_bytes: int
    """Over HTTP since it began."""
    cpu_s: float
    """Processor seconds since it began."""
    memory_bytes: int


class SiteNow(msgspec.Struct, frozen=True):
    """A whole site."""

    name: str
    now: float
    """The server's clock, unix seconds."""
    ready: bool
    """A best view can be served."""
    why: str
    """In one line: why it cannot, or how many cameras there are."""
    pulse: int | None
    """The newest one; None: not known, or there was none."""
    cameras: tuple[CameraNow, ...]
    people: tuple[PersonNow, ...]
    service: ServiceNow | None
    """None: whoever asks may not read ``/metrics``."""
