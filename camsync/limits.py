"""Limits of what a pulse server accepts from its clients."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """Limits and timeouts of a `PulseServer`."""

    catch_up: float = 0.5
    """Seconds of delay up to which the server still sends every pulse; beyond, it skips to the current
    one."""
    adopt_for: float = 30.0
    """Seconds after the first pulse in which clients that have counted further may move the schedule forward:
    the expected ones, or all where none is expected. Afterwards claims are ignored."""
    claims_for: float = 2.5
    """Seconds from when enough clients have claimed a count until the schedule continues there. The remaining
    clients can claim meanwhile: all reconnect within two seconds, and count by themselves until then."""
    counted_for: float = 10 * 365.25 * 86400.0
    """Longest plausible count, in seconds: ten years. Claims beyond that are ignored."""
    backlog: int = 4096
    """Bytes waiting for one client before pulses are dropped for it (a pulse has about 30)."""
    cut_off: float = 10.0
    """Seconds a client may stay behind, or leave data unacknowledged, before its connection is closed."""
    clients: int = 256
    """Connections at once, beside one for each expected name or user; a new one then replaces the oldest one
    of the address, or of the login, that has the most."""
    login_places: int = 8
    """Connections of one login at once, beside the one that has sent HELLO."""
    pending_logins: int = 256
    """Connections that have not logged in; a new one then replaces the oldest one of the address that has the
    most."""
    login_within: float = 5.0
    """Seconds from connecting until TLS is ready and the login was received."""
    line_burst: float = 100.0
    """Lines that a client may send at once."""
    line_rate: float = 20.0
    """Lines per second that a client may send in the long run; beyond that, its connection is closed."""


class LimitedConnection(Protocol):
    """A connection that counts against a limit."""

    @property
    def user_or_host(self) -> str:
        """The user that has logged in, or else the host."""


Connection = TypeVar("Connection", bound=LimitedConnection)


def select_evicted(connections: Sequence[Connection]) -> Connection:
    """Return the oldest connection of the user or host with the most; ``connections`` are oldest first.

    A client that opens very many connections evicts its own. Of equal ones that of the oldest connection
    counts.
    """
    counts = Counter(connection.user_or_host for connection in connections)
    most = max(counts.values())
    return next(connection for connection in connections if counts[connection.user_or_host] == most)
