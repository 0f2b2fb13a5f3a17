"""Frame pulses over TCP: every camera takes frame n when pulse n comes."""

from camsync.client import PulseClient
from camsync.clock import steady_unix_clock
from camsync.limits import ServerLimits
from camsync.log_throttle import Ended, Spell
from camsync.messages import Listener
from camsync.peer import ClientInfo
from camsync.proof import Login
from camsync.protocol import VERSION
from camsync.pulse import (
    AxisLostError,
    ClientSettings,
    Pulse,
    ReplacedError,
    SyncError,
    SyncStatus,
    VersionError,
)
from camsync.query import clients_of
from camsync.server import PulseServer

__all__ = [
    "VERSION",
    "AxisLostError",
    "ClientInfo",
    "ClientSettings",
    "Ended",
    "Listener",
    "Login",
    "Pulse",
    "PulseClient",
    "PulseServer",
    "ReplacedError",
    "ServerLimits",
    "Spell",
    "SyncError",
    "SyncStatus",
    "VersionError",
    "clients_of",
    "steady_unix_clock",
]
