"""Invalid input is refused, or counted and dropped: a short run of `python -m benchmarks.fuzz`."""

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
def _no_settings_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith("MYVIEW_") and "__" in name]:
        monkeypatch.delenv(name)


@pytest.mark.parametrize("target", ALL, ids=[target.name for target in ALL])
def test_no_input_crashes_a_target(target: type[Target], tmp_path: Path) -> None:
    result = TargetRunner(target, target.name, FuzzPlan(INPUTS, SECONDS, seed=7, out=tmp_path)).run()
    found = "\n\n".join(path.read_text() for path in sorted(tmp_path.glob("*.txt")))
    counts = result.counts
    assert counts.crashes == 0, found
    assert counts.inputs > 0
    assert counts.messages > 0
    assert counts.accepted + counts.refused == counts.inputs


@pytest.mark.parametrize("target", ALL, ids=[target.name for target in ALL])
@pytest.mark.slow
def test_the_inputs_of_a_target_are_reproducible(target: type[Target]) -> None:
    first, second = target(), target()
    try:
        inputs = [make_input(first, 1, index) for index in range(20)]
        assert inputs == [make_input(second, 1, index) for index in range(20)]
        assert len(set(inputs)) > 1
    finally:
        first.close()
        second.close()


class Broken(Target):
    """Crashes in every possible way."""

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


def test_all_kinds_of_crashes_are_counted_and_saved(tmp_path: Path) -> None:
    plan = FuzzPlan(INPUTS_OF_ALL_KINDS, seed=SEED, out=tmp_path, hang_s=0.7)
    counts = TargetRunner(Broken, Broken.name, plan).run().counts
    saved = {path.read_bytes() for path in tmp_path.glob("*.bin")}
    inputs = [make_input(Broken(), SEED, index) for index in range(INPUTS_OF_ALL_KINDS)]
    assert counts.inputs == counts.messages == INPUTS_OF_ALL_KINDS
    assert saved == set(inputs) - {b"right", b"wrong"}
    assert counts.accepted == inputs.count(b"right")
    assert counts.refused == inputs.count(b"wrong")
    for path in tmp_path.glob("*.bin"):
        assert path.read_bytes() == inputs[int(path.stem.rpartition(".")[2])]


class Raising(Broken):
    """Raises for some inputs."""

    name = "raising-reader"

    def make(self, rng: Random) -> bytes:
        return rng.choice((b"right", b"wrong", b"raises"))


class Accepting(Raising):
    """Accepts everything."""

    name = "accepting-reader"

    def feed(self, data: bytes) -> bool:
        return len(data) > 0


def test_parallel_targets_have_the_same_counts_as_sequential_ones() -> None:
    plan = FuzzPlan(INPUTS_OF_ALL_KINDS, seed=SEED)
    results = dict(run_parallel((Raising, Accepting, Accepting), plan, jobs=2))
    alone = TargetRunner(Raising, Raising.name, plan).run().counts
    assert sorted(results) == [0, 1, 2]
    assert results[0].counts == alone
    assert alone.crashes > 0
    assert results[1].counts.accepted == results[2].counts.accepted == INPUTS_OF_ALL_KINDS


class MessageTarget(ScriptTarget):
    """Receives several messages per input; one sequence kills its process."""

    name = "message-reader"

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


def test_messages_are_counted_even_if_the_process_dies() -> None:
    inputs = [make_input(MessageTarget(), SEED, index).split() for index in range(INPUTS)]
    handed = [messages.index(b"over") + 1 if b"over" in messages else len(messages) for messages in inputs]
    died = [messages == [b"right"] * 5 for messages in inputs]
    assert any(died)
    counts = TargetRunner(MessageTarget, MessageTarget.name, FuzzPlan(INPUTS, seed=SEED)).run().counts
    assert counts.messages == sum(1 if dead else count for count, dead in zip(handed, died, strict=True))
    assert counts.crashes == sum(died)


def test_a_run_ends_after_a_number_of_messages_and_can_be_resumed() -> None:
    complete = TargetRunner(MessageTarget, MessageTarget.name, FuzzPlan(messages=300, seed=SEED)).run().counts
    assert 300 <= complete.messages < 305
    suffix = TargetRunner(MessageTarget, MessageTarget.name, FuzzPlan(20, seed=SEED)).run().counts
    rest = (
        TargetRunner(MessageTarget, MessageTarget.name, FuzzPlan(complete.inputs - 20, seed=SEED, first=20))
        .run()
        .counts
    )
    assert suffix.messages + rest.messages == complete.messages
    assert suffix.accepted + rest.accepted == complete.accepted


def test_an_input_can_be_replayed() -> None:
    feeder = InputFeeder(Broken())
    with feeder.watching():
        assert feeder.feed(b"right") is True
        assert feeder.feed(b"wrong") is False
        found = feeder.feed(b"raises")
    assert isinstance(found, Crash)
    assert "KeyError" in found.text


@pytest.fixture(scope="module")
def unauthenticated() -> Iterator[UnauthenticatedRequests]:
    target = UnauthenticatedRequests()
    yield target
    target.close()


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("/api/objects", ""),
        ("/objects/1/best.mp4?from=p0", ""),
        ("/objects/2/best.ts?from=p0", "family"),
        ("/cameras/c1/live.mp4?from=p0", "door"),
        ("/api/operator/people", "hall"),
    ],
)
def test_missing_access_control_is_detected(
    path: str, name: str, unauthenticated: UnauthenticatedRequests, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = f"Authorization: Bearer {SECRETS[name]}\r\n" if name else ""
    request = f"\0GET {path} HTTP/1.1\r\nHost: x\r\n{token}Connection: close\r\n\r\n".encode()
    assert unauthenticated.feed(request) is False
    monkeypatch.setattr(authorization, "permission_for", lambda *_: Permission.PUBLIC)
    with pytest.raises(AssertionError, match=name or r"\[\]"):
        unauthenticated.feed(request)


@pytest.mark.parametrize("text", ["", "two\nlines", "x" * 5000, "Traceback (most recent call last)"])
def test_an_unreadable_refusal_is_a_crash(text: str) -> None:
    with pytest.raises(UnclearError):
        refused(ValueError(text))


@pytest.mark.parametrize("target", ALL, ids=[target.name for target in ALL])
@pytest.mark.slow
def test_a_target_restores_the_global_state(target: type[Target]) -> None:
    """Two targets overlap, and the first is closed first: their patches must be undone."""
    before = dict(os.environ), dict(vars(floor_plan))
    first, second = target(), target()
    for instance in (first, second):
        instance.hand_over(make_input(instance, 1, 0))
    first.close()
    second.close()
    assert (dict(os.environ), dict(vars(floor_plan))) == before
