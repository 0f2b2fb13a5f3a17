"""People seen by one camera only, though others should see them, are confirmed late: shadows and ghosts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings, TrackUpdate
from bestview.association.ghost_check import in_full_view
from fakes.bestview.identity_scenes import (
    CALIBRATED,
    STRIDE,
    VIEWS,
    StraightTrack,
    collect_updates,
    in_two_cameras,
)

WIDE, HIGH, TALL = 640, 440, 1.75
PICTURES = dict.fromkeys(VIEWS, (WIDE, HIGH))
SETTINGS = IdentitySettings(
    confirmation_s=1.0, joint_confirmation_s=0.6, ghost_penalty=4.0, clustering_interval_s=0.2
)


def created_at(
    stays: list[StraightTrack], picture_sizes: dict[str, tuple[int, int]], *uncalibrated: str
) -> list[int]:
    """Return the frames at which ids are created."""
    ground = {**CALIBRATED, **dict.fromkeys(uncalibrated)}
    seen = collect_updates(IdentityRegistry(SETTINGS, ground), stays, 300, picture_sizes=picture_sizes)
    return [(place + 1) * STRIDE for place, update in enumerate(seen) for _ in update.created]


def test_each_camera_that_misses_a_person_requires_more_frames() -> None:
    alone = [StraightTrack("south", 1, 0, 999, (0, 0))]
    two = {"south": (WIDE, HIGH), "west": (WIDE, HIGH)}
    assert created_at(alone, PICTURES) == [(1 + 2 * 4) * 25]
    assert created_at(alone, two) == [(1 + 4) * 25]
    assert created_at(alone, PICTURES, "west") == [(1 + 4) * 25], (
        "a camera without homography cannot miss a person"
    )
    assert created_at(alone, {}) == [25], "no other camera has reported"


def test_a_second_camera_that_sees_the_person_compensates_one_that_does_not() -> None:
    assert created_at(in_two_cameras(1, (0, 0)), PICTURES) == [15], "two cameras compensate the third"


@pytest.mark.parametrize(
    ("cameras", "frame"),
    [(("south",), (1 + 2 * 4) * 15), (("south", "west"), 10), (("south", "west", "north"), 5)],
)
def test_somebody_whom_cameras_track_together_is_confirmed_by_those_that_detect_them(
    cameras: tuple[str, ...], frame: int
) -> None:
    # On a map: without looks, as of somebody in a crowd.
    registry = IdentityRegistry(SETTINGS, {**CALIBRATED, "map": np.eye(3)})
    box, found = np.tile([0.0, -TALL, 0.0, 0.0], (STRIDE, 1)), np.ones(STRIDE, dtype=np.bool_)
    for first in range(0, 300, STRIDE):
        track = TrackUpdate("map", 1, first, box, detected=dict.fromkeys(cameras, found))
        if registry.update([track], first + STRIDE - 1, PICTURES).created:
            break
    assert first + STRIDE == frame


def test_cameras_whose_view_does_not_cover_the_place_are_not_missing() -> None:
    # Right below the western camera, and too far from the northern one.
    assert created_at([StraightTrack("south", 1, 0, 999, (-9.5, -4))], PICTURES) == [25]


def test_a_person_gone_before_confirmation_gets_no_id() -> None:
    assert created_at([StraightTrack("south", 1, 0, 80, (0, 0))], PICTURES) == []
    # The other cameras stop reporting once the person has left: nothing is missing, and nobody is there.
    seen = IdentityRegistry(SETTINGS, CALIBRATED)
    early = collect_updates(seen, [StraightTrack("south", 1, 0, 80, (0, 0))], 120, picture_sizes=PICTURES)
    late = collect_updates(seen, [], 300, start=120)
    assert not [update for update in early + late if update.created]


@given(st.floats(-12, 12), st.floats(-12, 12))
def test_full_view_means_inside_the_picture_and_large_enough(x: float, y: float) -> None:
    names = list(VIEWS)
    ground = np.array([CALIBRATED[name] for name in names], dtype=np.float64)
    visible = in_full_view(ground, np.full((3, 2), (WIDE, HIGH), dtype=np.float64), np.array([x, y]), TALL)
    for name, seen in zip(names, visible, strict=True):
        far = float((VIEWS[name] @ (x, y, 1.0))[2])
        assume(abs(far) > 0.01)
        person = StraightTrack(name, 1, 0, 0, (x, y)).box(0)
        assume(min(abs(margin) for margin in margins(person)) > 1e-6)
        assert seen == (far > 0 and min(margins(person)) > 0)


def margins(person: NDArray[np.float64]) -> list[float]:
    """Return by how much a box fulfills each condition of full view, pixels."""
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
    visible = in_full_view(plan[None], np.array([[640.0, 480.0]]), np.array([6.0, 6.0]), 1.75)
    assert visible.tolist() == [True]


@pytest.mark.parametrize("penalty", [0.0, 1e-9])
def test_without_ghost_penalty_everyone_needs_the_same_frames(penalty: float) -> None:
    registry = IdentityRegistry(replace(SETTINGS, ghost_penalty=penalty), CALIBRATED)
    seen = collect_updates(registry, [StraightTrack("south", 1, 0, 999, (0, 0))], 60, picture_sizes=PICTURES)
    assert sum(len(update.created) for update in seen) == 1
