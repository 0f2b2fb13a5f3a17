"""Which processes of a site fail: each in turn, and any two of them at once."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations

from benchmarks.faults.site.fault_site import FaultSite

BESTVIEW, SYNC, DRAWING = "bestview", "sync", "drawing"
SHOWN = "shown"
"""The camera that most viewers are shown."""
OTHER = "other"
"""The one that most of the rest are shown; where there is no rest, the next by its name."""
PROCESSES = (BESTVIEW, SYNC, SHOWN, OTHER, DRAWING)


def turns(*left_out: str) -> Iterator[tuple[str, ...]]:
    """Yield each process but some, then any two of them; the other camera fails only beside the shown one."""
    there = [process for process in PROCESSES if process not in left_out]
    for processes in (*combinations(there, 1), *combinations(there, 2)):
        if OTHER not in processes or SHOWN in processes:
            yield processes


def title(processes: Collection[str]) -> str:
    """Return them a name in the table, such as ``sync+camera``."""
    return "+".join("camera" if process in (SHOWN, OTHER) else process for process in processes)


def names(stand: FaultSite, processes: Collection[str]) -> list[str]:
    """Return the names of the processes in a site as it is now."""
    cameras = stand.shown()
    chosen = {SHOWN: cameras[0], OTHER: cameras[1]}
    return [chosen.get(process, process) for process in processes]
