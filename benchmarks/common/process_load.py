"""Processor usage of this process and its children, by name, and of the rest of the machine (Linux)."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_PROC = Path("/proc")
_TICKS = os.sysconf("SC_CLK_TCK")
_PARENT, _USER, _SYSTEM = 1, 11, 12
"""Fields in /proc/PID/stat after the command name (proc(5))."""
_IDLE = (3, 4)
"""Fields of idle and iowait in the first line of /proc/stat."""
_FIELDS = 8
"""Fields of that line before guest time, which user time includes."""

OTHER = "other work"


@dataclass(frozen=True, slots=True)
class ProcessorUsage:
    """Processor seconds used until a point in time."""

    at: float
    used: Mapping[str, float]
    """By process name; :data:`OTHER` is everything else on the machine."""

    def cores_since(self, earlier: ProcessorUsage) -> dict[str, float]:
        """Return the mean number of cores used since an earlier reading, by process name."""
        seconds = self.at - earlier.at
        return {name: (used - earlier.used.get(name, 0.0)) / seconds for name, used in self.used.items()}


def read_processor_usage() -> ProcessorUsage:
    """Read the processor time of this process, its descendants, and the rest of the machine."""
    running = _running()
    family = _family(running)
    used: dict[str, float] = {}
    for pid in sorted(family):
        name = _name(pid)
        used[name] = used.get(name, 0.0) + _seconds(running[pid])
    numbers = [int(word) for word in (_PROC / "stat").read_text().split("\n", 1)[0].split()[1:]]
    all_used = sum(number for field, number in enumerate(numbers[:_FIELDS]) if field not in _IDLE) / _TICKS
    used[OTHER] = all_used - sum(used.values())
    return ProcessorUsage(time.monotonic(), used)


def _running() -> dict[int, list[str]]:
    """Return the fields of /proc/PID/stat after the command name, by process id."""
    stats = {int(entry.name): _stat(entry) for entry in _PROC.iterdir() if entry.name.isdecimal()}
    return {pid: stat for pid, stat in stats.items() if stat}


def _stat(entry: Path) -> list[str]:
    try:
        return (entry / "stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has exited
        return []


def _family(running: Mapping[int, list[str]]) -> set[int]:
    """Return the ids of this process and all its descendants."""
    family = {os.getpid()}
    while children := {pid for pid, stat in running.items() if int(stat[_PARENT]) in family} - family:
        family |= children
    return family


def _name(pid: int) -> str:
    """Return a process's name: a command of `myview`, "rendering", "browser", or "measuring" (this one)."""
    if pid == os.getpid():
        return "measuring"
    words = _words(pid)
    if "server.service.rendering.worker" in words:
        return "rendering"
    if "server.cli.main" not in words:
        return "browser"
    command, *rest = words[words.index("server.cli.main") + 1 :]
    return f"camera {rest[1]}" if command == "camera" else command


def running_pids(name: str) -> list[int]:
    """Return the ids of the descendants with this name, such as ``camera c1``."""
    return [pid for pid in sorted(_family(_running())) if _name(pid) == name]


def processor_seconds(pid: int) -> float:
    """Return the processor seconds that a process has used; 0: it has exited."""
    stat = _stat(_PROC / str(pid))
    return _seconds(stat) if stat else 0.0


def _seconds(stat: Sequence[str]) -> float:
    return (int(stat[_USER]) + int(stat[_SYSTEM])) / _TICKS


def children_of(pid: int, module: str) -> list[int]:
    """Return the ids of a process's children that run a module of Python."""
    running = _running()
    children = [child for child, stat in running.items() if int(stat[_PARENT]) == pid]
    return [child for child in sorted(children) if module in _words(child)]


def _words(pid: int) -> list[str]:
    """Return a process's command line; empty: it has exited."""
    try:
        return (_PROC / str(pid) / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def lag_percentile(share: float, lags: Sequence[tuple[float, float]]) -> float:
    """Return a percentile of lags in seconds, by the bounds of a histogram with cumulative counts."""
    return next((bound for bound, count in lags if count >= share * lags[-1][1]), np.nan)
