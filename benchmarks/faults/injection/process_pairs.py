"""The sets of processes that fail: each one alone, and each pair."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations

from benchmarks.faults.site.fault_site import FaultSite

BESTVIEW, SYNC, RENDERING = "bestview", "sync", "rendering"
SHOWN = "shown"
"""The camera that most viewers are shown."""
OTHER = "other"
"""The camera that most other viewers are shown; without any, the next by name."""
PROCESSES = (BESTVIEW, SYNC, SHOWN, OTHER, RENDERING)


def process_sets(*excluded: str) -> Iterator[tuple[str, ...]]:
    """Yield each process except `excluded`, then each pair; OTHER fails only together with SHOWN."""
    available = [process for process in PROCESSES if process not in excluded]
    for processes in (*combinations(available, 1), *combinations(available, 2)):
        if OTHER not in processes or SHOWN in processes:
            yield processes


def title(processes: Collection[str]) -> str:
    """Return the name of processes in the table, such as ``sync+camera``."""
    return "+".join("camera" if process in (SHOWN, OTHER) else process for process in processes)


def names(fault_site: FaultSite, processes: Collection[str]) -> list[str]:
    """Return the names of the processes in a running site."""
    cameras = fault_site.shown()
    chosen = {SHOWN: cameras[0], OTHER: cameras[1]}
    return [chosen.get(process, process) for process in processes]
