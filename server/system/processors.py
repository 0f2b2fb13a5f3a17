"""The number of processors that this process may use (affinity, cgroups)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

_GROUPS = Path("/sys/fs/cgroup")
_OWN_GROUPS = Path("/proc/self/cgroup")


def available_processors(groups: Path = _GROUPS, own_groups: Path = _OWN_GROUPS) -> float:
    """Return the number of processors in the affinity mask, limited by the CPU quota of a container.

    ``groups`` is the folder of control groups, ``own_groups`` the file that lists those of this process.
    """
    has_affinity = hasattr(os, "sched_getaffinity")  # on Linux
    count = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
    return min([count, *_limits(groups, own_groups)])


def _limits(groups: Path, own_groups: Path) -> Iterator[float]:
    """Yield the CPU limits of this process's control groups and their parents."""
    with suppress(OSError):
        for line in own_groups.read_text(encoding="utf-8").splitlines():
            _, controllers, path = line.split(":", 2)
            root = groups if not controllers else groups / "cpu"
            if controllers and "cpu" not in controllers.split(","):
                continue
            group = PurePosixPath(path.lstrip("/"))
            for folder in (root / group, *(root / parent for parent in group.parents)):
                limit = _version_1(folder) if controllers else _version_2(folder)
                if limit is not None:
                    yield limit


def _version_2(folder: Path) -> float | None:
    """Read the limit of a version 2 group: "QUOTA PERIOD" in microseconds; "max" means no limit."""
    with suppress(OSError, ValueError):
        quota, period = (folder / "cpu.max").read_text(encoding="ascii").split()
        return int(quota) / int(period)
    return None


def _version_1(folder: Path) -> float | None:
    """Read the limit of a version 1 group from two files; -1 means no limit."""
    with suppress(OSError, ValueError):
        quota = int((folder / "cpu.cfs_quota_us").read_text(encoding="ascii"))
        period = int((folder / "cpu.cfs_period_us").read_text(encoding="ascii"))
        return quota / period if quota > 0 else None
    return None
