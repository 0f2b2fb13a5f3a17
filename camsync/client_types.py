"""Pulses, status, settings and errors of a pulse client."""

from __future__ import annotations

from dataclasses import dataclass


class SyncError(Exception):
    """The client has stopped for good; only a new client can continue."""


class ReplacedError(SyncError):
    """Another client of the same name has connected and replaced this one."""


class VersionError(SyncError):
    """The server speaks another version of the protocol."""


class LoginError(SyncError):
    """The server needs a login, or refuses this one."""


class ScheduleLostError(SyncError):
    """The server's count stays far behind what this client has counted."""


@dataclass(frozen=True, slots=True)
class Pulse:
    """One pulse: take frame ``number``."""

    number: int
    due: float
    """When it was due: unix seconds on the client's clock (``PulseClient.now()``)."""
    received: float
    """When it arrived, or was made by the client: same clock."""
    missed: int
    """Numbers skipped since the previous pulse: frames that will be missing."""
    own: bool
    """Made by the client itself, because the server is away or silent."""


@dataclass(frozen=True, slots=True)
class SyncStatus:
    """Connection status of a pulse client."""

    connected: bool
    """The server's greeting was received on the present connection."""
    pulse: int | None
    """The last pulse counted; None before the first."""
    fps: float
    """Pulses per second: the server's, or ``fps_hint`` before the first greeting."""
    offset: float | None
    """Server clock minus the client's clock, seconds; None before the first greeting."""
    round_trip: float | None
    """The shortest recent round trip, seconds; None before the first was measured."""
    missed: int
    """Pulses missed since the first one."""
    own: int
    """Pulses made by the client itself."""
    connections: int
    """Greetings received: above 1 after reconnecting."""
    waiting_for: tuple[str, ...]
    """The clients that the server waits for before pulse 0; empty after the first pulse."""


@dataclass(frozen=True, slots=True)
class ClientSettings:
    """Settings of a PulseClient."""

    queue: int = 50
    """Pulses queued for a slow consumer; beyond, the oldest are dropped. Many for recordings, where every
    frame counts; 1 for a live source, which has only its newest picture."""
    own_after: float = 0.1
    """Seconds after a pulse was due when a connected client makes it itself."""
    catch_up: float = 0.5
    """Seconds of missed pulses that the client makes after a stall; after a longer one, the count skips to
    the present."""
    free_run_after: float | None = None
    """Seconds without reaching any server until the client counts by itself from 0; None: it never does."""
    backoff_first: float = 0.1
    """Seconds before the first attempt to reconnect; doubled each time."""
    backoff_most: float = 2.0
    """Seconds between attempts at most."""
    connect_timeout: float = 3.0
    """Seconds that an attempt to connect may take."""
    ping_interval: float = 1.0
    """Seconds between measurements of the clock offset; the server takes 20 lines a second, no more."""
    silence: float = 5.0
    """Seconds without a byte from the server, which answers every ping, until the connection is closed."""
    ahead_most: float = 5.0
    """Seconds that the count may lead the server's before ScheduleLostError; below, the client waits."""
    settle: float = 2.0
    """Seconds that a new connection has to take up the client's count before ScheduleLostError."""
