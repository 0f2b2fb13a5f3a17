"""What was said of people by hand outlasts the service, as far as cameras' tracks do."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from cameras_by_hand import CAMERAS, FPS, LARGE, SMALL, STRIDE, FedService, small_config, tracks, word
from hypothesis import given, settings
from hypothesis import strategies as st

from server.view.by_hand_file import NAME, read, write
from server.view.followed import LONGEST_S, SaidByHand, Told
from server.view.locals import Followed
from server.wire.epochs import end_of_epoch
from server.wire.messages import Box

A, B = CAMERAS
Seen = Mapping[str, Mapping[int, Box]]
ALL: Seen = {A: {1: SMALL, 2: LARGE}, B: {3: LARGE}}
"""By camera the tracks that are there."""


def service(folder: Path | None, **changes: object) -> FedService:
    it = FedService(small_config(record={"folder": folder}, **changes))
    it.come(*CAMERAS)
    it.by_hand.open()
    return it


def tell(it: FedService, epochs: Iterable[int], seen: Seen = ALL, boot: int = 1) -> None:
    """Tell of who is seen; pictures are of no matter here."""
    for epoch in epochs:
        for camera in CAMERAS:
            it.intake.tracks(tracks(word(camera, epoch, seen[camera], boot=boot)))
        it.pulse = end_of_epoch(epoch, STRIDE)
        it.decide()
    if it.by_hand._writing is not None:
        it.by_hand._writing.result()


def whose(it: FedService, camera: str, track: int, epoch: int, boot: int = 1) -> int:
    number = it.decider.people.whose(camera, boot, track, end_of_epoch(epoch, STRIDE))
    assert number is not None
    return number


def told(folder: Path, *, merge: bool = False) -> FedService:
    """Run a service in which camera A's track 2 is Ann, and who is followed by its track 1, too, maybe."""
    it = service(folder)
    tell(it, range(4))
    people = it.decider.people
    people.call(whose(it, A, 2, 3), "Ann")
    if merge:
        people.merge(whose(it, A, 2, 3), whose(it, A, 1, 3))
    tell(it, range(4, 6))
    it.close()
    return it


def test_who_is_followed_all_along_has_their_name_again_whatever_their_number(tmp_path: Path) -> None:
    before = told(tmp_path)
    after = service(tmp_path)
    tell(after, range(7, 9), {A: {9: SMALL, 2: LARGE}, B: {}})
    number = whose(after, A, 2, 8)
    assert after.decider.people.names == {number: "Ann"}
    assert before.decider.people.names == {whose(before, A, 2, 5): "Ann"}
    assert after.decider.people.merged_by_hand == {}
    after.close()


def test_who_was_said_to_be_one_is_one_again(tmp_path: Path) -> None:
    told(tmp_path, merge=True)
    after = service(tmp_path)
    tell(after, range(7, 8), {A: {2: LARGE}, B: {}})
    tell(after, range(8, 10))  # the other track comes later
    people = after.decider.people
    assert whose(after, A, 1, 9) == whose(after, A, 2, 9)
    assert len(people.merged_by_hand) == 1
    assert people.names == {whose(after, A, 2, 9): "Ann"}
    after.close()


def test_a_third_run_knows_it_too(tmp_path: Path) -> None:
    told(tmp_path)
    second = service(tmp_path)
    tell(second, range(7, 9))
    second.close()
    third = service(tmp_path)
    tell(third, range(9, 11))
    assert third.decider.people.names == {whose(third, A, 2, 10): "Ann"}
    third.close()


@pytest.mark.parametrize(
    ("epochs", "boot"),
    [
        (range(7, 9), 2),  # the camera began anew: its tracks are other people's
        (range(6 + int(LONGEST_S * FPS / STRIDE), 8 + int(LONGEST_S * FPS / STRIDE)), 1),  # too long ago
        (range(2), 1),  # pulses began anew
    ],
)
def test_nobody_is_given_a_name_that_may_be_anothers(tmp_path: Path, epochs: range, boot: int) -> None:
    told(tmp_path)
    after = service(tmp_path)
    tell(after, epochs, boot=boot)
    assert after.decider.people.known
    assert after.decider.people.names == {}
    after.close()


def test_a_name_that_was_given_meanwhile_stays(tmp_path: Path) -> None:
    told(tmp_path)
    after = service(tmp_path)
    tell(after, range(7, 9), {A: {1: SMALL}, B: {}})
    people = after.decider.people
    people.call(whose(after, A, 1, 8), "Bob")
    tell(after, range(9, 11))
    assert sorted(people.names.values()) == ["Ann", "Bob"]
    assert people.names[whose(after, A, 1, 10)] == "Bob"
    after.close()


def test_a_name_that_was_taken_back_is_not_given_again(tmp_path: Path) -> None:
    told(tmp_path)
    second = service(tmp_path)
    tell(second, range(7, 9))
    second.decider.people.call(whose(second, A, 2, 8), "")
    tell(second, range(9, 10))
    second.close()
    third = service(tmp_path)
    tell(third, range(10, 12))
    assert third.decider.people.names == {}
    third.close()


def test_without_a_folder_and_of_several_services_nothing_is_kept(tmp_path: Path) -> None:
    for it in (service(None), service(tmp_path, view={"share": {"of": 2}})):
        tell(it, range(4))
        it.decider.people.call(whose(it, A, 2, 3), "Ann")
        tell(it, range(4, 6))
        it.close()
    assert list(tmp_path.iterdir()) == []


NESTED = b'{"more": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"


@pytest.mark.parametrize(
    "damage", [b"", b"\xff", b"[]", b'{"site": "hall", "pulse": 1}', b"{" * 100_000, NESTED]
)
def test_a_damaged_file_is_put_aside_and_it_is_said_in_one_line(
    tmp_path: Path, damage: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / NAME).write_bytes(damage)
    with caplog.at_level(logging.WARNING):
        it = service(tmp_path)
    [line] = caplog.messages
    assert "put aside as by_hand.json.damaged" in line
    assert "\n" not in line
    tell(it, range(3))
    assert it.decider.people.known
    it.close()
    assert (tmp_path / f"{NAME}.damaged").read_bytes() == damage


tracks_of_somebody = st.builds(Followed, st.sampled_from(CAMERAS), st.integers(0, 2**42), st.integers(0))
said = st.builds(
    SaidByHand,
    st.just("hall"),
    st.integers(0, 2**40),
    st.lists(st.builds(Told, st.text(max_size=40), st.booleans(), st.lists(tracks_of_somebody))),
)


@settings(max_examples=30)
@given(said, said)
def test_what_is_written_is_read_and_a_later_one_takes_its_place(one: SaidByHand, other: SaidByHand) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / NAME
        for it in (one, other):
            write(path, it)
            assert read(path) == it
        assert [it.name for it in path.parent.iterdir()] == [NAME]


def test_a_disk_that_takes_nothing_is_told_of_once_and_the_service_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    it = service(tmp_path)
    tell(it, range(3))
    (tmp_path / NAME).mkdir()  # where the file should be
    with caplog.at_level(logging.WARNING):
        for epoch, name in enumerate(("Ann", "Bob"), 3):
            it.decider.people.call(whose(it, A, 2, 2), name)
            tell(it, [epoch])
    [line] = caplog.messages
    assert line.startswith("what was said by hand is not kept: ")
    it.close()
