"""The picture of a person whom no camera sees is frozen and then gray, by any of their numbers."""

from __future__ import annotations

import pytest

from fakes.service.scripted_cameras import CAMERAS, GOP, NO_REASON
from server.service.streaming.presence import PresenceLog, ScopedPicture
from server.service.view_selection.decider import GopDecision

A, B = CAMERAS
BOX = (1.0, 2.0, 3.0, 4.0)
UNSEEN = 2 * GOP


def decision(
    gop: int, seen: dict[int, list[int]], merged: dict[int, int] | None = None, camera: str = A
) -> GopDecision:
    """Return a GOP in which people are seen at some of its places."""
    boxes = [[(number, *BOX) for number, places in seen.items() if place in places] for place in range(GOP)]
    return GopDecision(gop * GOP, GOP, (), {camera: boxes}, merged or {}, (), NO_REASON)


@pytest.fixture
def presence_log() -> PresenceLog:
    return PresenceLog(UNSEEN)


def test_a_person_who_was_never_seen_is_gray(presence_log: PresenceLog) -> None:
    presence_log.update(decision(0, {1: [0]}))
    assert presence_log.picture_of(1) is ScopedPicture.SHOWN
    assert presence_log.picture_of(2) is ScopedPicture.GRAY


@pytest.mark.parametrize(("place", "shown"), [(0, 2), (GOP - 1, 2)])
def test_a_person_who_leaves_is_shown_for_a_while_then_frozen_then_gray(
    presence_log: PresenceLog, place: int, shown: int
) -> None:
    presence_log.update(decision(0, {1: [place]}))
    found = []
    for gop in range(1, 9):
        presence_log.update(decision(gop, {}))
        found.append(presence_log.picture_of(1))
    held = [ScopedPicture.FROZEN] * (found.index(ScopedPicture.GRAY) - shown)
    assert found == [ScopedPicture.SHOWN] * shown + held + [ScopedPicture.GRAY] * (8 - shown - len(held))
    assert len(held) == 2


def test_one_box_in_any_camera_shows_a_person(presence_log: PresenceLog) -> None:
    presence_log.update(decision(0, {1: [0]}))
    presence_log.update(decision(9, {1: [GOP - 1]}, camera=B))
    assert presence_log.picture_of(1) is ScopedPicture.SHOWN


def test_merged_numbers_share_when_they_were_seen(presence_log: PresenceLog) -> None:
    presence_log.update(decision(0, {1: [0], 2: [0]}))
    presence_log.update(decision(4, {2: [0]}))
    presence_log.update(decision(5, {}, merged={2: 1}))
    assert presence_log.picture_of(1) is presence_log.picture_of(2) is ScopedPicture.SHOWN
    presence_log.update(decision(8, {2: [3]}, merged={2: 1}))
    assert presence_log.picture_of(1) is ScopedPicture.SHOWN, "also by boxes that still have the other number"


def test_restarted_pulses_make_all_persons_gray(presence_log: PresenceLog) -> None:
    presence_log.update(decision(100, {1: [0]}))
    presence_log.update(decision(0, {}))
    assert presence_log.picture_of(1) is ScopedPicture.GRAY


def test_a_forgotten_person_is_gray(presence_log: PresenceLog) -> None:
    presence_log.update(decision(0, {1: [0], 2: [0]}))
    presence_log.forget({2})
    assert presence_log.picture_of(1) is ScopedPicture.GRAY
    assert presence_log.picture_of(2) is ScopedPicture.SHOWN


def test_without_hide_time_a_person_is_present_only_in_gops_that_show_them() -> None:
    presence_log = PresenceLog(0)
    presence_log.update(decision(0, {1: [GOP - 1]}))
    assert presence_log.picture_of(1) is ScopedPicture.SHOWN
    presence_log.update(decision(1, {}))
    assert presence_log.picture_of(1) is ScopedPicture.GRAY
