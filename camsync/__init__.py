"""Frame pulses over TCP: every camera takes frame n when pulse n arrives.

`PulseServer` sends the pulses, `PulseClient` iterates over them, and `query_clients` lists a server's
clients. The wire format is in `camsync.protocol`.
"""

from camsync.client import PulseClient
from camsync.client_connection import ClientInfo
from camsync.client_types import (
    ClientSettings,
    LoginError,
    Pulse,
    ReplacedError,
    ScheduleLostError,
    SyncError,
    SyncStatus,
    VersionError,
)
from camsync.clock import steady_unix_clock
from camsync.limits import ServerLimits
from camsync.login import Credentials
from camsync.messages import ListedClient
from camsync.protocol import VERSION
from camsync.query import query_clients
from camsync.server import PulseServer

__all__ = [
    "VERSION",
    "ClientInfo",
    "ClientSettings",
    "Credentials",
    "ListedClient",
    "LoginError",
    "Pulse",
    "PulseClient",
    "PulseServer",
    "ReplacedError",
    "ScheduleLostError",
    "ServerLimits",
    "SyncError",
    "SyncStatus",
    "VersionError",
    "query_clients",
    "steady_unix_clock",
]
