"""The failover benchmark: what counts as a changed number and as a kept promise; HAProxy as configured."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from itertools import groupby

import pytest

from benchmarks.common.environment import ROOT
from benchmarks.common.report import Report
from benchmarks.faults.failover.failover_run import FailoverOutcome, changed_numbers, numbers_of
from benchmarks.faults.failover.failover_table import describe
from benchmarks.faults.failover.failures import (
    CAMERA,
    FAILURES,
    FOLLOWER,
    LEADER,
    MOVED_S,
    NOTICED_S,
)
from benchmarks.faults.failover.two_services import JOINT
from benchmarks.faults.failover.viewers import PlainPlayer
from benchmarks.faults.video.stamped_views import FRAMES, StampedViews
from benchmarks.faults.viewing.picture_check import GOP_S
from client import Box, Gop

LEFT, RIGHT = (10.0, 10.0, 30.0, 60.0), (80.0, 10.0, 100.0, 60.0)
PEOPLE = {("c0", frame): {1: LEFT, 2: RIGHT} for frame in range(FRAMES)}
VIEWS = StampedViews([], {}, None, {}, PEOPLE)


def gop(first: int, left: int, right: int, shift: float = 3.0) -> Gop:
    """Return a GOP in which the two people have these numbers, with boxes beside the true ones."""
    boxes = [
        Box(number, *(side + shift for side in sides)) for number, sides in ((left, LEFT), (right, RIGHT))
    ]
    return Gop(first=first, frames=10, choices={}, boxes={"c0": (tuple(boxes),) * 10}, cuts=())


def outcome_of(target: str, **changes: object) -> FailoverOutcome:
    failure = next(failure for failure in FAILURES if failure.target == target)
    kept = FailoverOutcome(failure, others={"client": 0.5}, own={"client": 0.5}, lost=1)
    return replace(kept, **changes)  # type: ignore[arg-type]


def test_each_process_is_killed_frozen_and_cut_off() -> None:
    assert {failure.name for failure in FAILURES} == {
        f"{how} {target}"
        for how in ("kill", "freeze", "cut off")
        for target in (LEADER, FOLLOWER, "sync", CAMERA, JOINT)
        if (how, target) != ("cut off", JOINT)  # it runs on its service's host
    }
    kinds = [(failure.cuts_off, failure.is_joint) for failure in FAILURES]
    assert len(list(groupby(kinds))) == len(set(kinds)), "failures in one kind of site follow each other"


def test_a_number_is_that_of_the_person_whom_its_boxes_show() -> None:
    assert numbers_of(gop(FRAMES - 5, 7, 9), VIEWS) == {1: 7, 2: 9}
    assert numbers_of(gop(0, 7, 9, shift=25.0), VIEWS) == {}


@pytest.mark.parametrize(
    ("one", "other", "changed"),
    [
        ([(1, 2)] * 10, [(1, 2)] * 10, 0),
        ([(1, 2)] * 10, [(1, 2)] * 5 + [(1, 3)] * 5, 1),
        ([(1, 2)] * 10, [(2, 1)] * 10, 2),
        ([(1, 2)] * 10, [(1, 2)] * 9 + [(2, 1)], 0),
    ],
    ids=["same", "changed", "differs between services", "confused for a moment"],
)
def test_changed_numbers(one: list[tuple[int, int]], other: list[tuple[int, int]], changed: int) -> None:
    seen = [[gop(10 * place, *numbers) for place, numbers in enumerate(log)] for log in (one, other)]
    assert changed_numbers(seen, VIEWS) == changed


def test_viewers_of_a_service_that_fails_have_longer_than_others() -> None:
    assert outcome_of(LEADER).keeps_promises
    assert outcome_of(LEADER, own={"client": MOVED_S}).keeps_promises
    assert not outcome_of(LEADER, own={"client": 0.5, "page": MOVED_S + 0.1}).keeps_promises
    assert not outcome_of(LEADER, others={"client": NOTICED_S + 0.1}).keeps_promises
    assert not outcome_of("sync", own={"client": NOTICED_S + 0.1}).keeps_promises


@pytest.mark.parametrize(
    "change",
    [{"broken": 1}, {"wrong": 1}, {"changed": 1}, {"lost": 2}, {"broken_files": 1}, {"failed": "no"}],
)
def test_each_broken_promise_is_seen(change: dict[str, object]) -> None:
    outcome = outcome_of(LEADER, **change)
    assert not outcome.keeps_promises
    describe(Report(), [outcome])


def test_the_gap_of_a_player_is_beyond_the_usual_and_counts_what_never_comes() -> None:
    player = PlainPlayer("http://localhost/", 1, 0)
    player.arrivals = [10.0, 10.4, 10.8, 12.6]
    assert player.gap(10.5, 12.7) == pytest.approx(1.8 - GOP_S)
    assert player.gap(10.5, 20.0) == pytest.approx(7.4 - GOP_S)


def test_haproxy_accepts_its_configuration() -> None:
    program = shutil.which("haproxy") or shutil.which("haproxy", path="/usr/sbin")
    if program is None:
        pytest.skip("needs HAProxy; on Debian: apt install haproxy")
    services = {f"MYVIEW_SERVICE_{index}": f"127.0.0.1:{8080 + index}" for index in range(2)}
    done = subprocess.run(
        [program, "-c", "-f", str(ROOT / "configs" / "haproxy.cfg")],
        env={"MYVIEW_FRONT": "127.0.0.1:8000", **services},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
