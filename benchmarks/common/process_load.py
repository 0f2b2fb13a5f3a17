"""Processor use of the child processes, by name, and of the rest of the machine (Linux)."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

_PROC = Path("/proc")
_TICKS = os.sysconf("SC_CLK_TCK")
_PARENT, _USER, _SYSTEM = 1, 11, 12
"""Fields in /proc/PID/stat after the command name (proc(5))."""
_IDLE = (3, 4)
"""Fields of idle and iowait in the first line of /proc/stat."""
_COUNTED = 8
"""Fields of that line before guest time, which user time includes."""

OTHER = "other work"


@dataclass(frozen=True, slots=True)
class ProcessorUsage:
    """Processor seconds used up to a moment."""

    at: float
    used: Mapping[str, float]
    """By process name; :data:`OTHER` is everything else on the machine."""

    def cores_since(self, earlier: ProcessorUsage) -> dict[str, float]:
        """Return the cores used since an earlier moment, by process name."""
        passed = self.at - earlier.at
        return {name: (used - earlier.used.get(name, 0.0)) / passed for name, used in self.used.items()}


def busy_now() -> ProcessorUsage:
    """Read the processor time of this process, its descendants, and the rest of the machine."""
    found = {int(entry.name): _stat(entry) for entry in _PROC.iterdir() if entry.name.isdecimal()}
    running = {pid: stat for pid, stat in found.items() if stat}
    ours = _family(running)
    used: dict[str, float] = {}
    for pid in sorted(ours):
        name = _name(pid)
        used[name] = used.get(name, 0.0) + (int(running[pid][_USER]) + int(running[pid][_SYSTEM])) / _TICKS
    numbers = [int(word) for word in (_PROC / "stat").read_text().split("\n", 1)[0].split()[1:]]
    all_used = sum(number for place, number in enumerate(numbers[:_COUNTED]) if place not in _IDLE) / _TICKS
    used[OTHER] = all_used - sum(used.values())
    return ProcessorUsage(time.monotonic(), used)


def _stat(entry: Path) -> list[str]:
    try:
        return (entry / "stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has exited meanwhile
        return []


def _family(running: Mapping[int, list[str]]) -> set[int]:
    """Return the ids of this process and all its descendants."""
    family = {os.getpid()}
    grown = True
    while grown:
        more = {pid for pid, stat in running.items() if int(stat[_PARENT]) in family} - family
        grown = bool(more)
        family |= more
    return family


def _name(pid: int) -> str:
    """Return the name of a process: a command of `myview`, the browser, or this measurement."""
    if pid == os.getpid():
        return "measuring"
    try:
        words = (_PROC / str(pid) / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return "browser"
    if "server.service.rendering.worker" in words:
        return "drawing"
    if "server.cli.main" not in words:
        return "browser"
    command, *rest = words[words.index("server.cli.main") + 1 :]
    return f"camera {rest[1]}" if command == "camera" else command


def running_pids(name: str) -> list[int]:
    """Return the ids of the descendants with this name, such as ``camera c1``."""
    running = {int(entry.name): _stat(entry) for entry in _PROC.iterdir() if entry.name.isdecimal()}
    family = _family({pid: stat for pid, stat in running.items() if stat})
    return [pid for pid in sorted(family) if _name(pid) == name]
