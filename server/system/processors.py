"""The number of processors that this process may use (affinity, cgroups)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

_GROUPS = Path("/sys/fs/cgroup")
_OF_THIS = Path("/proc/self/cgroup")


def available_processors(groups: Path = _GROUPS, of_this: Path = _OF_THIS) -> float:
    """Return their number: those it may run on, or the share of them that a container is given.

    ``groups`` is where the kernel's control groups are, ``of_this`` says which are this process's.
    """
    known = hasattr(os, "sched_getaffinity")  # on Linux
    there = len(os.sched_getaffinity(0)) if known else os.cpu_count() or 1
    return min([there, *_limits(groups, of_this)])


def _limits(groups: Path, of_this: Path) -> Iterator[float]:
    """Return the limits of all groups that this process is in, from its own up to the whole machine's."""
    with suppress(OSError):
        for line in of_this.read_text(encoding="utf-8").splitlines():
            _, controllers, path = line.split(":", 2)
            root = groups if not controllers else groups / "cpu"
            if controllers and "cpu" not in controllers.split(","):
                continue
            own = PurePosixPath(path.lstrip("/"))
            for folder in (root / own, *(root / it for it in own.parents)):
                limit = _version_1(folder) if controllers else _version_2(folder)
                if limit is not None:
                    yield limit


def _version_2(folder: Path) -> float | None:
    """Read "MICROSECONDS PERIOD", where "max" is no limit."""
    with suppress(OSError, ValueError):
        quota, period = (folder / "cpu.max").read_text(encoding="ascii").split()
        return int(quota) / int(period)
    return None


def _version_1(folder: Path) -> float | None:
    """Read the same from two files, where -1 is no limit."""
    with suppress(OSError, ValueError):
        quota = int((folder / "cpu.cfs_quota_us").read_text(encoding="ascii"))
        period = int((folder / "cpu.cfs_period_us").read_text(encoding="ascii"))
        return quota / period if quota > 0 else None
    return None
