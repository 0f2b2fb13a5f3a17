"""What a pulse client gives to its user."""

from __future__ import annotations

from dataclasses import dataclass


class SyncError(Exception):
    """The client cannot go on: starting it anew is the only remedy."""


class ReplacedError(SyncError):
    """Another client of the same name has come; the newer one stays."""


class VersionError(SyncError):
    """The server speaks another version of the protocol."""


class LoginError(SyncError):
    """The server needs a login, or refuses this one."""


class AxisLostError(SyncError):
    """The server counts far behind what this client has counted, and goes on so."""


@dataclass(frozen=True, slots=True)
class Pulse:
    """One pulse: take frame ``number``."""

    number: int
    due: float
    """When it was due: unix seconds on the client's clock (``PulseClient.now()``)."""
    received: float
    """When it came, or was made by the client: same clock."""
    missed: int
    """Numbers between the pulse before this one and this one: the frames that will be missing."""
    own: bool
    """Made by the client at its own rate, the server being away."""


@dataclass(frozen=True, slots=True)
class SyncStatus:
    """How a pulse client stands."""

    connected: bool
    """The server's greeting was heard on the present connection."""
    pulse: int | None
    """The last pulse counted; None before the first."""
    fps: float
    """Pulses per second: the server's, or the hint before it was heard."""
    offset: float | None
    """Server clock minus the client's clock, seconds; None before a server was heard."""
    round_trip: float | None
    """The shortest recent round trip, seconds; None before the first was measured."""
    missed: int
    """Pulses missed since the first one."""
    own: int
    """Pulses made by the client itself."""
    connections: int
    """How many times the server was greeted by: above 1 after reconnecting."""
    waiting_for: tuple[str, ...]
    """Whom the server has not begun without, as far as it said; empty after the first pulse."""


@dataclass(frozen=True, slots=True)
class ClientSettings:
    """Settings of a PulseClient."""

    queue: int = 50
    """Pulses kept for a consumer that is slow for a moment; beyond, the oldest are dropped. Many for
    recordings, whose every frame counts; 1 for a live source, which has only the newest picture to give."""
    own_after: float = 0.1
    """Seconds after a pulse was due that a connected client makes it itself."""
    catch_up: float = 0.5
    """Seconds of pulses that the client makes good itself after a stall; after a longer one, the count skips
    to the present."""
    free_run_after: float | None = None
    """Seconds without ever reaching a server until the client counts alone from 0; None: waits for ever."""
    backoff_first: float = 0.1
    """Seconds before the first attempt to reconnect; doubled each time."""
    backoff_most: float = 2.0
    """Seconds between attempts at most."""
    connect_timeout: float = 3.0
    """Seconds that an attempt to connect may take."""
    ping_interval: float = 1.0
    """Seconds between measurements of the clock offset; the server takes 20 lines a second, no more."""
    silence: float = 5.0
    """Seconds without a byte from the server (it answers every ping) until it is taken for gone."""
    ahead_most: float = 5.0
    """Seconds that the count may be ahead of the server's before AxisLostError; less is waited for."""
    settle: float = 2.0
    """Seconds that a new connection has to take up the client's count before that is judged."""
