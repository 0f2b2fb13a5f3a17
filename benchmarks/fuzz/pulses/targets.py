"""The pulse protocol: its lines, whole sessions of server and client without sockets, and over real ones."""

from __future__ import annotations

from benchmarks.fuzz.pulses.protocol_lines import ProtocolLines
from benchmarks.fuzz.pulses.sessions import ClientSessions, ServerSessions
from benchmarks.fuzz.pulses.sockets import SocketBytes
from benchmarks.fuzz.pulses.unauthenticated import UnauthenticatedClients

TARGETS = (ProtocolLines, ServerSessions, ClientSessions, UnauthenticatedClients, SocketBytes)
