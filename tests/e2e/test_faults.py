"""Faults of `python -m benchmarks.faults` in a real site: the promises that do not depend on load."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.common.report import Report
from benchmarks.faults.failover.__main__ import measure as measure_failover
from benchmarks.faults.failover.failures import FAILURES, LEADER
from benchmarks.faults.injection import processes as faults_processes
from benchmarks.faults.outcomes.measurement import measure

pytestmark = [pytest.mark.live, pytest.mark.slow]

NAMES = ("kill camera", "kill sync")


async def test_viewers_notice_neither_a_killed_camera_nor_killed_pulses(tmp_path: Path) -> None:
    chosen = [fault for fault in faults_processes.FAULTS if fault.name in NAMES]
    outcomes = await measure(chosen, tmp_path, Report())
    assert [outcome.fault.name for outcome in outcomes] == [fault.name for fault in chosen]
    for outcome in outcomes:
        assert not outcome.failed, outcome.fault.name
        assert outcome.reconnections == 0, outcome.fault.name
        assert sum(received.frames for received in outcome.received) > 100
        assert [note for received in outcome.received for note in received.notes] == []
        assert (outcome.lost, outcome.broken_files) == (0, 0)


async def test_viewers_of_every_kind_go_on_when_their_service_is_killed(tmp_path: Path) -> None:
    chosen = [failure for failure in FAILURES if failure.name == f"kill {LEADER}"]
    (outcome,) = await measure_failover(chosen, tmp_path, Report())
    assert not outcome.failed
    assert (outcome.broken, outcome.wrong, outcome.changed, outcome.broken_files) == (0, 0, 0, 0)
    assert outcome.reconnections["client"]
