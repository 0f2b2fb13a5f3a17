"""Where a view is missed and expected, the larger worth counts; what is found stays as it is."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import VisibleViews, add_inferred_views

SHAPE = FRAMES, CAMERAS, PEOPLE = 4, 2, 3
View = tuple[int, int, int]


def line_up(worth: dict[View, float]) -> tuple[list[int], list[int], list[int], list[float]]:
    frame, camera, person = ([view[side] for view in worth] for side in range(3))
    return frame, camera, person, list(worth.values())


@settings(deadline=None, max_examples=80)
@given(st.integers(0, 2**32 - 1))
def test_every_view_is_there_once_and_with_the_larger_worth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kind, worth = rng.integers(0, 5, SHAPE), rng.uniform(0.1, 1.0, (2, *SHAPE))
    every = list(np.ndindex(SHAPE))
    found = {it: float(worth[0][it]) for it in every if kind[it] == 1}
    missed = {it: float(worth[0][it]) for it in every if kind[it] in {2, 3}}
    expected = {it: float(worth[1][it]) for it in every if kind[it] in {3, 4}}
    columns = [np.array(side) for side in line_up(found | missed)]
    shown = np.ones((FRAMES, CAMERAS), dtype=np.bool_)
    frames, cameras, people, worths = columns
    views = VisibleViews(frames, cameras, people, worths, shown, PEOPLE, detected_count=len(found))
    frame, camera, person, extra = (np.array(side) for side in line_up(expected))
    views = add_inferred_views(
        views, frame.astype(int), camera.astype(int), person.astype(int), extra.astype(float)
    )
    at = zip(views.frame.tolist(), views.camera.tolist(), views.person.tolist(), strict=True)
    both = dict(zip(at, views.quality.tolist(), strict=True))
    assert len(both) == len(views.frame), "each view once"
    assert dict(list(both.items())[: views.detected_count]) == found
    assert both == found | {it: max(missed.get(it, 0.0), expected.get(it, 0.0)) for it in missed | expected}
