"""Identities in a site of many halls equal those of separate sites, at linear cost."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bestview import AppearanceHistogram, IdentityRegistry, IdentitySettings, TrackUpdate

STRIDE, UPDATES, PEOPLE = 5, 40, 8
PIXEL = 0.01
"""Meters on the floor, seen from above."""
SIDE = 12.0
"""Meters of a hall's walls; 100 m lie between two halls."""


def ground(hall: int) -> NDArray[np.float64]:
    """Return the homography of a camera over a hall."""
    return np.array([[PIXEL, 0.0, 100.0 * hall], [0.0, PIXEL, 0.0], [0.0, 0.0, 1.0]])


def walks() -> NDArray[np.float64]:
    """Return positions in a hall, (people, frames, 2) meters: straight lines, reflected at the walls."""
    rng = np.random.default_rng(4)
    heading = rng.uniform(0, 2 * np.pi, PEOPLE)
    velocity = 0.05 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    unfolded = rng.uniform(0, SIDE, (PEOPLE, 1, 2)) + velocity[:, None] * np.arange(STRIDE * UPDATES)[:, None]
    return np.asarray(SIDE - np.abs(unfolded % (2 * SIDE) - SIDE))


def tracks(hall: int, update: int, places: NDArray[np.float64]) -> list[TrackUpdate]:
    """Return the tracks of two cameras over a hall, with noise and gaps."""
    found = []
    first = STRIDE * update
    coats = np.random.default_rng(0).dirichlet(np.full(16, 0.3), PEOPLE)
    for camera in (2 * hall, 2 * hall + 1):
        rng = np.random.default_rng([camera % 2, update])
        for person in range(PEOPLE):
            # Every track is lost for a while from time to time, and another one follows.
            track_number, phase = divmod(update + 5 * person + 3 * (camera % 2), 15)
            if phase >= 12:
                continue
            feet = (places[person, first : first + STRIDE] + rng.normal(0, 0.1, (STRIDE, 2))) / PIXEL
            boxes = np.column_stack([feet - np.array([20, 170]), feet + np.array([20, 0])])
            sample = AppearanceHistogram(first, first + STRIDE - 1, coats[person] * rng.uniform(0.8, 1.2, 16))
            found.append(TrackUpdate(f"c{camera:03d}", 100 * track_number + person, first, boxes, (sample,)))
    return found


def run_halls(halls: range) -> tuple[list[dict[tuple[int, str, int, int], int]], int]:
    """Return the ids after each update, by hall and tracklet, and the number of pair entries."""
    names = {f"c{camera:03d}": ground(camera // 2) for hall in halls for camera in (2 * hall, 2 * hall + 1)}
    identities = IdentityRegistry(IdentitySettings(), dict(names))
    places, ids_by_update = walks(), []
    for update in range(UPDATES):
        track_updates = [track for hall in halls for track in tracks(hall, update, places)]
        numbers = identities.update(track_updates, STRIDE * (update + 1) - 1).person_ids
        ids_by_update.append(
            {
                (int(key.camera[1:]) // 2, key.camera, key.local_id, key.first_frame): number
                for key, number in numbers.items()
            }
        )
    return ids_by_update, identities._affinity.entry_count


@pytest.fixture(scope="module")
def together() -> tuple[list[dict[tuple[int, str, int, int], int]], int]:
    return run_halls(range(4))


def test_pair_entries_grow_linearly_with_the_number_of_halls(
    together: tuple[list[dict[tuple[int, str, int, int], int]], int],
) -> None:
    _, alone = run_halls(range(1))
    assert alone > 0
    assert together[1] == 4 * alone


@pytest.mark.parametrize("hall", [0, 3])
def test_identities_in_a_hall_do_not_depend_on_other_halls(
    hall: int, together: tuple[list[dict[tuple[int, str, int, int], int]], int]
) -> None:
    alone, _ = run_halls(range(hall, hall + 1))
    for ids_alone, ids_together in zip(alone, together[0], strict=True):
        here = {key: number for key, number in ids_together.items() if key[0] == hall}
        assert here.keys() == ids_alone.keys()
        pairs = {(ids_alone[key], here[key]) for key in ids_alone}
        # Ids may differ, but correspond one to one.
        assert len(pairs) == len({one for one, _ in pairs}) == len({two for _, two in pairs})
    assert max(alone[-1].values()) >= PEOPLE // 2
