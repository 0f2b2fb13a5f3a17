"""Bytes that nobody meant are refused, or counted and dropped: a short run of `python -m benchmarks.fuzz`."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from benchmarks.fuzz.__main__ import PARTS, run_parallel, targets_of
from benchmarks.fuzz.engine.runner import Crash, FuzzPlan, InputFeeder, TargetRunner, make_input
from benchmarks.fuzz.engine.target import ScriptTarget, Target, UnclearError, refused
from benchmarks.fuzz.http.unauthenticated import SECRETS, UnauthenticatedRequests
from server.http.access import authorization
from server.http.access.permissions import Permission
from server.service.calibration import floor_plan

SECONDS = 0.25
INPUTS = 1000
INPUTS_OF_ALL_KINDS, SEED = 9, 80
ALL = [target for part in PARTS for target in targets_of(part)]


@pytest.fixture(autouse=True)
def _no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith("MYVIEW_") and "__" in name]:
        monkeypatch.delenv(name)


@pytest.mark.parametrize("target", ALL, ids=[target.name for target in ALL])
def test_no_input_makes_it_crash(target: type[Target], tmp_path: Path) -> None:
    result = TargetRunner(target, target.name, FuzzPlan(INPUTS, SECONDS, seed=7, out=tmp_path)).run()
    found = "\n\n".join(path.read_text() for path in sorted(tmp_path.glob("*.txt")))
    counts = result.counts
    assert counts.crashes == 0, found
    assert counts.inputs > 0
    assert counts.messages > 0
    assert counts.accepted + counts.refused == counts.inputs


@pytest.mark.parametrize("target", ALL, ids=[target.name for target in ALL])
def test_its_inputs_are_the_same_in_every_run(target: type[Target]) -> None:
    one, other = target(), target()
    try:
        inputs = [make_input(one, 1, index) for index in range(20)]
        assert inputs == [make_input(other, 1, index) for index in range(20)]
        assert len(set(inputs)) > 1
    finally:
        one.close()
        other.close()


class Broken(Target):
    """Crashes in every way there is."""

    name = "broken-reader"

    def make(self, rng: Random) -> bytes:
        return rng.choice((b"right", b"wrong", b"raises", b"hangs", b"grows", b"dies"))

    def feed(self, data: bytes) -> bool:
        match data:
            case b"right":
                return True
            case b"wrong":
                return refused("it is wrong")
            case b"raises":
                raise KeyError(data)
            case b"hangs":
                while True:
                    pass
            case b"grows":
                return len(b"x" * 300_000_000) > 0
            case _:
                os.kill(os.getpid(), signal.SIGKILL)
                return False


def test_whatever_a_reader_does_wrong_is_counted_and_saved(tmp_path: Path) -> None:
    plan = FuzzPlan(INPUTS_OF_ALL_KINDS, seed=SEED, out=tmp_path, hang_s=0.7)
    counts = TargetRunner(Broken, Broken.name, plan).run().counts
    saved = {path.read_bytes() for path in tmp_path.glob("*.bin")}
    given = [make_input(Broken(), SEED, index) for index in range(INPUTS_OF_ALL_KINDS)]
    assert counts.inputs == counts.messages == INPUTS_OF_ALL_KINDS
    assert saved == set(given) - {b"right", b"wrong"}
    assert counts.accepted == given.count(b"right")
    assert counts.refused == given.count(b"wrong")
    for path in tmp_path.glob("*.bin"):
        assert path.read_bytes() == given[int(path.stem.rpartition(".")[2])]


class Raising(Broken):
    """Now and then raises."""

    name = "raising-reader"

    def make(self, rng: Random) -> bytes:
        return rng.choice((b"right", b"wrong", b"raises"))


class Sound(Raising):
    """Takes everything."""

    name = "sound-reader"

    def feed(self, data: bytes) -> bool:
        return len(data) > 0


def test_targets_side_by_side_count_as_they_do_one_by_one() -> None:
    plan = FuzzPlan(INPUTS_OF_ALL_KINDS, seed=SEED)
    results = dict(run_parallel((Raising, Sound, Sound), plan, jobs=2))
    alone = TargetRunner(Raising, Raising.name, plan).run().counts
    assert sorted(results) == [0, 1, 2]
    assert results[0].counts == alone
    assert alone.crashes > 0
    assert results[1].counts.accepted == results[2].counts.accepted == INPUTS_OF_ALL_KINDS


class Talking(ScriptTarget):
    """Is told words one by one, and dies of one of them."""

    name = "talking-reader"

    def make(self, rng: Random) -> bytes:
        return b" ".join(rng.choice((b"right", b"wrong", b"over")) for _ in range(5))

    def feed(self, data: bytes) -> bool:
        for word in data.split():
            self.messages += 1
            if word == b"over":
                return False
        if data.count(b"right") == len(data.split()):
            os.kill(os.getpid(), signal.SIGKILL)
        return True


def test_messages_are_counted_that_were_handed_over_though_a_process_dies() -> None:
    inputs = [make_input(Talking(), SEED, index).split() for index in range(INPUTS)]
    handed = [messages.index(b"over") + 1 if b"over" in messages else len(messages) for messages in inputs]
    died = [messages == [b"right"] * 5 for messages in inputs]
    assert any(died)
    counts = TargetRunner(Talking, Talking.name, FuzzPlan(INPUTS, seed=SEED)).run().counts
    assert counts.messages == sum(1 if dead else count for count, dead in zip(handed, died, strict=True))
    assert counts.crashes == sum(died)


def test_so_many_messages_end_it_and_it_goes_on_from_there() -> None:
    whole = TargetRunner(Talking, Talking.name, FuzzPlan(messages=300, seed=SEED)).run().counts
    assert 300 <= whole.messages < 305
    suffix = TargetRunner(Talking, Talking.name, FuzzPlan(20, seed=SEED)).run().counts
    rest = TargetRunner(Talking, Talking.name, FuzzPlan(whole.inputs - 20, seed=SEED, first=20)).run().counts
    assert suffix.messages + rest.messages == whole.messages
    assert suffix.accepted + rest.accepted == whole.accepted


def test_a_saved_input_says_again_what_it_did() -> None:
    feeder = InputFeeder(Broken())
    with feeder.watching():
        assert feeder.feed(b"right") is True
        assert feeder.feed(b"wrong") is False
        found = feeder.feed(b"raises")
    assert isinstance(found, Crash)
    assert "KeyError" in found.text


@pytest.fixture(scope="module")
def strangers() -> Iterator[UnauthenticatedRequests]:
    target = UnauthenticatedRequests()
    yield target
    target.close()


@pytest.mark.parametrize(
    ("asked", "who"),
    [
        ("/api/objects", ""),
        ("/objects/1/best.mp4?from=p0", ""),
        ("/objects/2/best.ts?from=p0", "family"),
        ("/cameras/c1/live.mp4?from=p0", "door"),
        ("/api/operator/people", "hall"),
    ],
)
def test_a_site_that_lets_anybody_in_is_found_out(
    asked: str, who: str, strangers: UnauthenticatedRequests, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = f"Authorization: Bearer {SECRETS[who]}\r\n" if who else ""
    request = f"\0GET {asked} HTTP/1.1\r\nHost: x\r\n{token}Connection: close\r\n\r\n".encode()
    assert strangers.feed(request) is False
    monkeypatch.setattr(authorization, "permission_for", lambda *_: Permission.PUBLIC)
    with pytest.raises(AssertionError, match=who or r"\[\]"):
        strangers.feed(request)


@pytest.mark.parametrize("text", ["", "two\nlines", "x" * 5000, "Traceback (most recent call last)"])
def test_a_refusal_that_nobody_can_read_is_none(text: str) -> None:
    with pytest.raises(UnclearError):
        refused(ValueError(text))


@pytest.mark.parametrize("target", ALL, ids=[target.name for target in ALL])
def test_it_leaves_everything_else_as_it_was(target: type[Target]) -> None:
    """Two at once, and the first ended first: what they foresee or hide must not outlive them."""
    before = dict(os.environ), dict(vars(floor_plan))
    one, other = target(), target()
    for it in (one, other):
        it.hand_over(make_input(it, 1, 0))
    one.close()
    other.close()
    assert (dict(os.environ), dict(vars(floor_plan))) == before
