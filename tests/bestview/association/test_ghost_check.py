"""Who is seen by one camera, though others should see them, is given a number late: shadows, and ghosts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings
from bestview.association.ghost_check import fully_in_view
from fakes.bestview.identity_scenes import CALIBRATED, STRIDE, VIEWS, Stay, both, play

WIDE, HIGH, TALL = 640, 440, 1.75
SPEAKING = dict.fromkeys(VIEWS, (WIDE, HIGH))
SETTINGS = IdentitySettings(confirmation_frames=25, ghost_penalty=4.0, clustering_interval=5)


def born(stays: list[Stay], speaking: dict[str, tuple[int, int]], *blind: str) -> list[int]:
    """By which frames somebody gets a number; cameras that are `blind` have no homography."""
    ground = {**CALIBRATED, **dict.fromkeys(blind)}
    seen = play(IdentityRegistry(SETTINGS, ground), stays, 300, speaking=speaking)
    return [(place + 1) * STRIDE for place, update in enumerate(seen) for _ in update.created]


def test_each_camera_that_misses_a_person_requires_more_frames() -> None:
    alone = [Stay("south", 1, 0, 999, (0, 0))]
    two = {"south": (WIDE, HIGH), "west": (WIDE, HIGH)}
    assert born(alone, SPEAKING) == [(1 + 2 * 4) * 25]
    assert born(alone, two) == [(1 + 4) * 25]
    assert born(alone, SPEAKING, "west") == [(1 + 4) * 25], "who has no homography cannot be asked"
    assert born(alone, {}) == [25], "nobody else has spoken"


def test_a_second_camera_that_sees_the_person_compensates_one_that_does_not() -> None:
    assert born(both(1, (0, 0)), SPEAKING) == [15], "of two cameras, as without the third"


def test_no_camera_is_missing_where_none_looks() -> None:
    # Right below the western camera, and too far from the northern one.
    assert born([Stay("south", 1, 0, 999, (-9.5, -4))], SPEAKING) == [25]


def test_a_person_gone_before_confirmation_gets_no_id() -> None:
    assert born([Stay("south", 1, 0, 80, (0, 0))], SPEAKING) == []
    # The others fall silent: there is no reason to doubt any more, and nobody there.
    seen = IdentityRegistry(SETTINGS, CALIBRATED)
    early = play(seen, [Stay("south", 1, 0, 80, (0, 0))], 120, speaking=SPEAKING)
    late = play(seen, [], 300, start=120)
    assert not [update for update in early + late if update.created]


@given(st.floats(-12, 12), st.floats(-12, 12))
def test_full_view_means_inside_the_picture_and_large_enough(x: float, y: float) -> None:
    names = list(VIEWS)
    ground = np.array([CALIBRATED[name] for name in names], dtype=np.float64)
    told = fully_in_view(ground, np.full((3, 2), (WIDE, HIGH), dtype=np.float64), np.array([x, y]), TALL)
    for name, seen in zip(names, told, strict=True):
        far = float((VIEWS[name] @ (x, y, 1.0))[2])
        assume(abs(far) > 0.01)
        person = Stay(name, 1, 0, 0, (x, y)).box(0)
        assume(min(abs(it) for it in margins(person)) > 1e-6)
        assert seen == (far > 0 and min(margins(person)) > 0)


def margins(person: NDArray[np.float64]) -> list[float]:
    """How far a box is from where it would not be in full view any more, pixels."""
    left, top, right, bottom = person.tolist()
    middle, tall = (left + right) / 2, bottom - top
    return [
        middle - tall / 4,
        WIDE - middle - tall / 4,
        top,
        HIGH - bottom - tall / 10,
        tall - 0.15 * HIGH,
    ]


def test_a_plan_view_without_horizon_counts_too() -> None:
    plan = np.diag([0.02, 0.02, 1.0])
    told = fully_in_view(plan[None], np.array([[640.0, 480.0]]), np.array([6.0, 6.0]), 1.75)
    assert told.tolist() == [True]


@pytest.mark.parametrize("doubt", [0.0, 1e-9])
def test_without_ghost_penalty_everyone_needs_the_same_frames(doubt: float) -> None:
    registry = IdentityRegistry(replace(SETTINGS, ghost_penalty=doubt), CALIBRATED)
    seen = play(registry, [Stay("south", 1, 0, 999, (0, 0))], 60, speaking=SPEAKING)
    assert sum(len(update.created) for update in seen) == 1
