"""Ids that tracks took from each other come back once people are seen alone again, if their looks say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fakes.tracking.strolls import (
    TEST_COSTS,
    WalkingPerson,
    detections_at,
    final_boxes,
    peaked_histogram,
    track_all,
)
from tracking.solvers.base import create_solver
from tracking.tracker import OnlineTracker
from tracking.types import Detections
from tracking.window import WindowSettings

_FRAMES = 140
_MIXED = 5


def _tracker() -> OnlineTracker:
    return OnlineTracker(WindowSettings(), TEST_COSTS, create_solver("columns"))


def _meeting(after: tuple[int, int]) -> list[Detections]:
    """Return the detections of two people who walk up to each other, stand together, and walk on.

    They are one box while they are together, and their looks are mixed until they are well apart. Before,
    they look like 0 and 3, from left to right; `after`: from then on.
    """
    frames = []
    for frame in range(_FRAMES):
        away = 2.0 * max(frame - 60, 0)
        looks = (_MIXED, _MIXED) if frame < 75 else after
        if frame < 40:
            people = [
                WalkingPerson(100.0 + 2 * frame, 50.0, 0.0, 0),
                WalkingPerson(260.0 - 2 * frame, 50.0, 0.0, 3),
            ]
        elif frame < 60:
            people = [WalkingPerson(180.0, 50.0, 0.0, _MIXED)]
        else:
            people = [
                WalkingPerson(180.0 + away * side, 50.0, 0.0, look)
                for side, look in zip((-1, 1), looks, strict=True)
            ]
        frames.append(detections_at(people, frame, 0.5))
    return frames


def _ids_at(found: dict[int, dict[int, np.ndarray]], frame: int) -> list[int]:
    """Return the ids from left to right."""
    return sorted(found[frame], key=lambda number: float(found[frame][number][0]))


@pytest.mark.parametrize("after", [(0, 3), (3, 0)])
def test_who_parts_after_standing_together_gets_the_id_of_who_looked_so(after: tuple[int, int]) -> None:
    found = final_boxes(track_all(_meeting(after), _tracker()))
    ids = dict(zip((0, 3), _ids_at(found, 30), strict=True))
    assert _ids_at(found, _FRAMES - 1) == [ids[look] for look in after]


def test_who_looks_the_same_is_not_exchanged() -> None:
    frames = _meeting((0, 0))
    found = final_boxes(track_all(frames, _tracker()))
    assert _ids_at(found, 85) == _ids_at(found, _FRAMES - 1)


def test_who_looks_like_nobody_gets_no_id_of_somebody_else() -> None:
    walker = WalkingPerson(100.0, 50.0, 1.0, 0, seen=range(50))
    other = WalkingPerson(60.0, 50.0, 1.0, 6, seen=range(80, _FRAMES))
    found = final_boxes(
        track_all([detections_at([walker, other], n, 0.5) for n in range(_FRAMES)], _tracker())
    )
    assert set(found[30]).isdisjoint(found[_FRAMES - 1])


def test_a_new_id_ends_once_its_person_looks_as_before() -> None:
    """Somebody comes out from behind something into other light, and then slowly looks the same again."""
    person = WalkingPerson(100.0, 50.0, 2.0, 0)
    frames = []
    for n in range(_FRAMES):
        share = 0.0 if n < 50 else min(max((110 - n) / 40.0, 0.0), 1.0)
        looks = (1.0 - share) * peaked_histogram(0) + share * peaked_histogram(_MIXED)
        seen = detections_at([person] if n < 50 or n >= 70 else [], n, 0.5)
        frames.append(replace(seen, histograms=np.tile(looks, (len(seen), 1))))
    found = final_boxes(track_all(frames, _tracker()))
    assert set(found[40]) == {1}
    assert set(found[90]) == {2}
    assert set(found[_FRAMES - 1]) == {1}
