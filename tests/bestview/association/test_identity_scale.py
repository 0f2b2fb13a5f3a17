"""A site of many halls is as many sites of one hall: who cannot meet has no say in who is who."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bestview import AppearanceSample, IdentityRegistry, IdentitySettings, TrackUpdate

STRIDE, UPDATES, PEOPLE = 5, 40, 8
PIXEL = 0.01
"""Metres on the floor, seen from above."""
SIDE = 12.0
"""Metres of a hall's walls; 100 m lie between two halls."""


def ground(hall: int) -> NDArray[np.float64]:
    """Return the homography of a camera over a hall."""
    return np.array([[PIXEL, 0.0, 100.0 * hall], [0.0, PIXEL, 0.0], [0.0, 0.0, 1.0]])


def walks() -> NDArray[np.float64]:
    """Everybody's places in a hall, (people, frames, 2) metres: straight ahead, and back from the walls."""
    rng = np.random.default_rng(4)
    turn = rng.uniform(0, 2 * np.pi, PEOPLE)
    pace = 0.05 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    way = rng.uniform(0, SIDE, (PEOPLE, 1, 2)) + pace[:, None] * np.arange(STRIDE * UPDATES)[:, None]
    return np.asarray(SIDE - np.abs(way % (2 * SIDE) - SIDE))


def tracks(hall: int, update: int, places: NDArray[np.float64]) -> list[TrackUpdate]:
    """What two cameras say of a hall: both see the same, but for noise, and all but some of the time."""
    found = []
    first = STRIDE * update
    coats = np.random.default_rng(0).dirichlet(np.full(16, 0.3), PEOPLE)
    for camera in (2 * hall, 2 * hall + 1):
        rng = np.random.default_rng([camera % 2, update])
        for person in range(PEOPLE):
            # Everybody is lost for a while now and then, and then is another track.
            turn, rest = divmod(update + 5 * person + 3 * (camera % 2), 15)
            if rest >= 12:
                continue
            feet = (places[person, first : first + STRIDE] + rng.normal(0, 0.1, (STRIDE, 2))) / PIXEL
            boxes = np.column_stack([feet - np.array([20, 170]), feet + np.array([20, 0])])
            look = AppearanceSample(first, first + STRIDE - 1, coats[person] * rng.uniform(0.8, 1.2, 16))
            found.append(TrackUpdate(f"c{camera:03d}", 100 * turn + person, first, boxes, (look,)))
    return found


def carried(halls: range) -> tuple[list[dict[tuple[int, str, int, int], int]], int]:
    """Who is who after each update, by place in the hall and track; and how many pairs are known of."""
    names = {f"c{camera:03d}": ground(camera // 2) for hall in halls for camera in (2 * hall, 2 * hall + 1)}
    who = IdentityRegistry(IdentitySettings(), dict(names))
    places, told = walks(), []
    for update in range(UPDATES):
        seen = [track for hall in halls for track in tracks(hall, update, places)]
        numbers = who.update(seen, STRIDE * (update + 1) - 1).person_ids
        told.append(
            {
                (int(it.camera[1:]) // 2, it.camera, it.local_id, it.first_frame): number
                for it, number in numbers.items()
            }
        )
    return told, who.pair_count


@pytest.fixture(scope="module")
def together() -> tuple[list[dict[tuple[int, str, int, int], int]], int]:
    return carried(range(4))


def test_pair_entries_grow_linearly_with_the_number_of_halls(
    together: tuple[list[dict[tuple[int, str, int, int], int]], int],
) -> None:
    _, alone = carried(range(1))
    assert alone > 0
    assert together[1] == 4 * alone


@pytest.mark.parametrize("hall", [0, 3])
def test_identities_in_a_hall_do_not_depend_on_other_halls(
    hall: int, together: tuple[list[dict[tuple[int, str, int, int], int]], int]
) -> None:
    alone, _ = carried(range(hall, hall + 1))
    for mine, theirs in zip(alone, together[0], strict=True):
        here = {key: number for key, number in theirs.items() if key[0] == hall}
        assert here.keys() == mine.keys()
        pairs = {(mine[key], here[key]) for key in mine}
        # Numbers differ, but each stands for one of the others.
        assert len(pairs) == len({one for one, _ in pairs}) == len({two for _, two in pairs})
    assert max(alone[-1].values()) >= PEOPLE // 2
