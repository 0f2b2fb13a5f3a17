"""The sets of processes that fail in the fault benchmark."""

from __future__ import annotations

from pathlib import Path

from benchmarks.faults.__main__ import FAULTS
from benchmarks.faults.injection.process_pairs import (
    BESTVIEW,
    OTHER,
    RENDERING,
    SHOWN,
    names,
    process_sets,
    title,
)
from benchmarks.faults.site.fault_site import FaultSite
from benchmarks.faults.viewing.viewers import Viewer
from client import Gop


def test_each_process_and_each_pair_of_processes_fails() -> None:
    assert [title(processes) for processes in process_sets()] == [
        *("bestview", "sync", "camera", "rendering"),
        *("bestview+sync", "bestview+camera", "bestview+rendering"),
        *("sync+camera", "sync+rendering", "camera+camera", "camera+rendering"),
    ]
    assert all(BESTVIEW not in processes for processes in process_sets(BESTVIEW))
    named = [fault.name for fault in FAULTS]
    assert len(set(named)) == len(named)
    for mode, excluded in (("kill", ()), ("freeze", ()), ("restart", (RENDERING,))):
        assert {f"{mode} {title(processes)}" for processes in process_sets(*excluded)} <= set(named)


def test_the_failing_cameras_are_the_watched_ones() -> None:
    fault_site = FaultSite("here", Path(), 0)
    fault_site.events.add(Gop(first=0, frames=10, choices={1: "c2", 2: "c1", 3: "c2"}, boxes={}, cuts=()))
    assert names(fault_site, ("sync", SHOWN, OTHER)) == ["sync", "c0", "c1"]
    fault_site.viewers = [Viewer("http://localhost/", number) for number in (1, 2, 3)]
    assert names(fault_site, ("sync", SHOWN, OTHER)) == ["sync", "c2", "c1"]
