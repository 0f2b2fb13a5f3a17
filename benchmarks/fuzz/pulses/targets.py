"""The pulse protocol: its lines, whole sessions of server and client without sockets, and over real ones."""

from __future__ import annotations

from benchmarks.fuzz.pulses.protocol_lines import Lines
from benchmarks.fuzz.pulses.sessions import ClientSessions, ServerSessions
from benchmarks.fuzz.pulses.sockets import Sockets
from benchmarks.fuzz.pulses.unauthenticated import Strangers

TARGETS = (Lines, ServerSessions, ClientSessions, Strangers, Sockets)
