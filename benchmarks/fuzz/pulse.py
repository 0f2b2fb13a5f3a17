"""The pulse protocol: its lines, whole sessions of server and client without sockets, and over real ones."""

from __future__ import annotations

from benchmarks.fuzz.pulse_lines import Lines
from benchmarks.fuzz.pulse_sessions import ClientSessions, ServerSessions
from benchmarks.fuzz.pulse_sockets import Sockets
from benchmarks.fuzz.pulse_strangers import Strangers

TARGETS = (Lines, ServerSessions, ClientSessions, Strangers, Sockets)
