"""The targets of the pulse protocol: lines, sessions without sockets, and real sockets."""

from __future__ import annotations

from benchmarks.fuzz.pulses.protocol_lines import ProtocolLines
from benchmarks.fuzz.pulses.sessions import ClientSessions, ServerSessions
from benchmarks.fuzz.pulses.sockets import SocketBytes
from benchmarks.fuzz.pulses.unauthenticated import UnauthenticatedClients

TARGETS = (ProtocolLines, ServerSessions, ClientSessions, UnauthenticatedClients, SocketBytes)
