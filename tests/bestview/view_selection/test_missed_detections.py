"""Who is missed for a moment is taken to be still there, less and less."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import LastDetections, VisibleViews, add_missed_detections

FRAMES, CAMERAS, PEOPLE = 8, 2, 3
SHAPE = (FRAMES, CAMERAS, PEOPLE)


def views_of(worth: NDArray[np.float64], shown: NDArray[np.bool_]) -> VisibleViews:
    """Put (N, C, K) worths, NaN where there is no view, into line camera by camera."""
    camera, frame, person = np.nonzero(~np.isnan(worth.transpose(1, 0, 2)))
    return VisibleViews(frame, camera, person, worth[frame, camera, person], shown, PEOPLE)


def slowly(
    worth: NDArray[np.float64], shown: NDArray[np.bool_], last: LastDetections, lasts: float
) -> dict[tuple[int, int, int], float]:
    """Return every view's quality, frame by frame."""
    found = {}
    for c, k in np.ndindex(CAMERAS, PEOPLE):
        seen, value = -last.age[c, k], last.quality[c, k]
        for n in range(FRAMES):
            if not np.isnan(worth[n, c, k]):
                seen, value = n, worth[n, c, k]
                found[n, c, k] = value
            elif shown[n, c] and n - seen < lasts:
                found[n, c, k] = value * (1.0 - (n - seen) / lasts)
    return found


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1.0, 1.5, 3.0, 4.7, 25.0]))
def test_missed_views_are_those_of_the_slow_way_to_the_bit(seed: int, lasts: float) -> None:
    rng = np.random.default_rng(seed)
    worth = np.where(rng.random(SHAPE) < 0.5, rng.uniform(0.1, 1.0, SHAPE), np.nan)
    shown = rng.random((FRAMES, CAMERAS)) < 0.9
    worth[~shown] = np.nan
    ago = rng.choice([1.0, 2.0, 4.0, np.inf], (CAMERAS, PEOPLE))
    last = LastDetections(ago, rng.uniform(0.1, 1.0, (CAMERAS, PEOPLE)))
    views = add_missed_detections(views_of(worth, shown), last, lasts)
    at = zip(views.frame.tolist(), views.camera.tolist(), views.person.tolist(), strict=True)
    found = dict(zip(at, views.quality.tolist(), strict=True))
    assert len(found) == len(views.frame), "each view once"
    assert found == slowly(worth, shown, last, lasts if lasts > 1.0 else 0.0)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, FRAMES - 1))
def test_a_window_that_is_cut_in_two_misses_the_same(seed: int, cut: int) -> None:
    rng = np.random.default_rng(seed)
    worth = np.where(rng.random(SHAPE) < 0.5, rng.uniform(0.1, 1.0, SHAPE), np.nan)
    shown = np.ones((FRAMES, CAMERAS), dtype=np.bool_)
    never = LastDetections(np.full((CAMERAS, PEOPLE), np.inf), np.zeros((CAMERAS, PEOPLE)))
    whole = add_missed_detections(views_of(worth, shown), never, 4.0)
    seen = never.advanced_to(views_of(worth, shown), cut)
    rest = add_missed_detections(views_of(worth[cut:], shown[cut:]), seen, 4.0)

    def of(views: VisibleViews, shift: int) -> dict[tuple[int, int, int], float]:
        at = zip((views.frame + shift).tolist(), views.camera.tolist(), views.person.tolist(), strict=True)
        return {it: value for it, value in zip(at, views.quality.tolist(), strict=True) if it[0] >= cut}

    assert of(rest, cut) == of(whole, 0)
