"""Grounds that disagree come together over the people whom several cameras see."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview.alignment import GroundAlignment
from bestview.evidence import TrackKey
from bestview.sightings import Sightings

HEIGHT, GATE = 1.75, 1.2
FRAMES = 5

Floats = NDArray[np.float64]


def sightings(**ground: Floats) -> Sightings:
    """Give (N, 2) places per camera, standing; row i of every camera is person i. NaN: not seen."""
    keys = tuple(TrackKey(camera, i) for camera in sorted(ground) for i in range(len(ground[camera])))
    places = np.concatenate([ground[camera] for camera in sorted(ground)])
    shape = (len(keys), FRAMES)
    return Sightings(
        keys,
        0,
        np.zeros((*shape, 4)),
        np.repeat(places[:, None], FRAMES, axis=1),
        np.zeros((*shape, 2, 2)),
        np.full(shape, HEIGHT),
    )


def learn(alignment: GroundAlignment, seen: Sightings, person: NDArray[np.int64]) -> None:
    present = np.ones(len(seen.keys), dtype=np.bool_)
    alignment.learn(seen, alignment.corrected(seen), person, present, GATE, HEIGHT)


def apart(seen: Sightings) -> float:
    """Give how far apart two cameras see the same people, at most."""
    one, two = np.split(seen.ground[:, 0], 2)
    return float(np.nanmax(np.hypot(*(one - two).T)))


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000))
def test_cameras_that_disagree_the_same_way_everywhere_come_to_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shift, linear = rng.uniform(-0.6, 0.6, 2), rng.uniform(-0.05, 0.05, (2, 2))
    alignment = GroundAlignment(trust=20.0)

    def crowd() -> Sightings:
        at = rng.uniform(-8.0, 8.0, (6, 2))
        return sightings(a=at, b=at + shift + at @ linear)

    before = crowd()
    assert alignment.corrected(before) is before
    for _ in range(80):
        learn(alignment, crowd(), np.tile(np.arange(6), 2))
    after = crowd()
    assert apart(alignment.corrected(after)) < 0.25 * apart(after)


def test_one_update_is_the_ridge_regression_written_out() -> None:
    rng = np.random.default_rng(1)
    at, off = rng.uniform(-5.0, 5.0, (9, 2)), rng.uniform(-0.5, 0.5, (9, 2))
    seen, trust = sightings(a=at, b=at + off), 7.0
    alignment = GroundAlignment(trust)
    learn(alignment, seen, np.tile(np.arange(9), 2))
    arm = 5.0 * HEIGHT
    centred = at - at.mean(axis=0)
    shift = off.sum(axis=0) / (9 + trust)
    rows = np.concatenate([centred, np.sqrt(trust) * arm * np.eye(2)])
    linear = np.linalg.lstsq(rows, np.concatenate([off - off.mean(axis=0), np.zeros((2, 2))]), rcond=None)[0]
    moved = alignment.corrected(seen).ground[:9, 0] - at
    np.testing.assert_allclose(moved, shift + centred @ linear, atol=1e-9)


def test_nothing_moves_where_nobody_is_seen_twice_or_the_ground_is_trusted_without_end() -> None:
    at = np.array([[0.0, 0.0], [3.0, 1.0]])
    seen = sightings(a=at, b=at + 0.5)
    strangers, trusting = GroundAlignment(10.0), GroundAlignment(np.inf)
    for _ in range(20):
        learn(strangers, seen, np.arange(4))
        learn(trusting, seen, np.tile(np.arange(2), 2))
    np.testing.assert_array_equal(strangers.corrected(seen).ground, seen.ground)
    np.testing.assert_array_equal(trusting.corrected(seen).ground, seen.ground)


def test_who_is_hidden_from_a_camera_or_joined_by_mistake_teaches_nothing() -> None:
    at = np.array([[0.0, 0.0], [3.0, 1.0]])
    hidden, far = at.copy(), at.copy()
    hidden[1] = np.nan
    far[1] += 3.0 * GATE
    for other in (hidden, far):
        alignment = GroundAlignment(10.0)
        seen = sightings(a=at, b=other)
        learn(alignment, seen, np.tile(np.arange(2), 2))
        np.testing.assert_allclose(alignment.corrected(seen).ground[0], seen.ground[0])


@pytest.mark.parametrize("nobody", [np.empty((0, 2)), np.full((1, 2), np.nan)])
def test_an_empty_room_teaches_nothing(nobody: Floats) -> None:
    alignment = GroundAlignment(10.0)
    seen = sightings(a=nobody, b=nobody)
    learn(alignment, seen, np.zeros(2 * len(nobody), dtype=np.int64))
    assert alignment.corrected(seen) is seen
