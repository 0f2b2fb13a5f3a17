"""How much a pulse server bears from its clients, and when it gives a pulse up."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """Settings of a PulseServer that are right for nearly everyone."""

    catch_up: float = 0.5
    """Seconds that the server may be late and still send every pulse; later, it skips to the current one."""
    adopt_for: float = 30.0
    """Seconds after the first pulse in which clients that have counted further may move the axis forward:
    the expected ones, or all where nobody is expected. A server long running follows nobody."""
    claims_for: float = 2.5
    """Seconds from when enough clients have said how far they have counted until the axis goes on there, so
    that the others can say it, too: all come back within two seconds. They count on meanwhile."""
    counted_for: float = 10 * 365.25 * 86400.0
    """Seconds that a client can have counted for: ten years. What claims more is not believed."""
    backlog: int = 4096
    """Bytes waiting for one client before pulses are dropped for it (a pulse has about 30)."""
    cut_off: float = 10.0
    """Seconds a client may stay behind, or not acknowledge what was sent, before it is cut off."""
    clients: int = 256
    """Connections at once, beside one for each name that is expected or a user's; more take the places of the
    oldest ones of the address, or of the login, that has the most."""
    login_places: int = 8
    """Connections of one login at once, beside the one that has said HELLO: those that ask who is there."""
    strangers: int = 256
    """Connections to a closed server that have not proven who they are; more take the places of the oldest
    ones of the address that has the most."""
    prove_within: float = 5.0
    """Seconds that they have for it."""
    line_burst: float = 100.0
    """Lines that a client may send at once."""
    line_rate: float = 20.0
    """Lines per second that a client may send in the long run; beyond, it is cut off."""
