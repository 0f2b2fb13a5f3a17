"""Views without a detection: kept for a while after a miss, or inferred from other cameras."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import LastDetections, VisibleViews, add_inferred_views, add_missed_detections

FRAMES, CAMERAS, PEOPLE = 8, 2, 3
SHAPE = (FRAMES, CAMERAS, PEOPLE)
INFERRED_SHAPE = (4, CAMERAS, PEOPLE)

View = tuple[int, int, int]
"""Frame, camera and person."""


def visible_views(quality: NDArray[np.float64], available: NDArray[np.bool_]) -> VisibleViews:
    """Build views from (N, C, K) qualities, NaN where there is no view, camera by camera."""
    camera, frame, person = np.nonzero(~np.isnan(quality.transpose(1, 0, 2)))
    return VisibleViews(frame, camera, person, quality[frame, camera, person], available, PEOPLE)


def quality_by_view(views: VisibleViews, first_frame: int = 0) -> dict[View, float]:
    frame = (views.frame + first_frame).tolist()
    keys = zip(frame, views.camera.tolist(), views.person.tolist(), strict=True)
    by_view = dict(zip(keys, views.quality.tolist(), strict=True))
    assert len(by_view) == len(views.frame), "each view occurs once"
    return by_view


def reference_qualities(
    quality: NDArray[np.float64], available: NDArray[np.bool_], last: LastDetections, decay_frames: float
) -> dict[View, float]:
    """Compute every view's quality frame by frame."""
    by_view = {}
    for camera, person in np.ndindex(CAMERAS, PEOPLE):
        last_frame, last_quality = -last.age[camera, person], last.quality[camera, person]
        for frame in range(FRAMES):
            if not np.isnan(quality[frame, camera, person]):
                last_frame, last_quality = frame, quality[frame, camera, person]
                by_view[frame, camera, person] = last_quality
            elif available[frame, camera] and frame - last_frame < decay_frames:
                decay = 1.0 - (frame - last_frame) / decay_frames
                by_view[frame, camera, person] = last_quality * decay
    return by_view


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1.0, 1.5, 3.0, 4.7, 25.0]))
def test_missed_detections_equal_the_reference_bit_for_bit(seed: int, decay_frames: float) -> None:
    rng = np.random.default_rng(seed)
    quality = np.where(rng.random(SHAPE) < 0.5, rng.uniform(0.1, 1.0, SHAPE), np.nan)
    available = rng.random((FRAMES, CAMERAS)) < 0.9
    quality[~available] = np.nan
    age = rng.choice([1.0, 2.0, 4.0, np.inf], (CAMERAS, PEOPLE))
    last = LastDetections(age, rng.uniform(0.1, 1.0, (CAMERAS, PEOPLE)))
    views = add_missed_detections(visible_views(quality, available), last, decay_frames)
    effective_decay = decay_frames if decay_frames > 1.0 else 0.0
    assert quality_by_view(views) == reference_qualities(quality, available, last, effective_decay)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, FRAMES - 1))
def test_a_window_cut_in_two_has_the_same_missed_detections(seed: int, cut: int) -> None:
    rng = np.random.default_rng(seed)
    quality = np.where(rng.random(SHAPE) < 0.5, rng.uniform(0.1, 1.0, SHAPE), np.nan)
    available = np.ones((FRAMES, CAMERAS), dtype=np.bool_)
    never = LastDetections(np.full((CAMERAS, PEOPLE), np.inf), np.zeros((CAMERAS, PEOPLE)))
    whole = add_missed_detections(visible_views(quality, available), never, 4.0)
    last = never.advanced_to(visible_views(quality, available), cut)
    rest = add_missed_detections(visible_views(quality[cut:], available[cut:]), last, 4.0)
    after_cut = {view: value for view, value in quality_by_view(whole).items() if view[0] >= cut}
    assert quality_by_view(rest, cut) == after_cut


def columns(by_view: dict[View, float]) -> tuple[list[int], list[int], list[int], list[float]]:
    frame, camera, person = ([view[side] for view in by_view] for side in range(3))
    return frame, camera, person, list(by_view.values())


@settings(deadline=None, max_examples=80)
@given(st.integers(0, 2**32 - 1))
def test_every_view_occurs_once_with_the_larger_inferred_quality(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kind, quality = rng.integers(0, 5, INFERRED_SHAPE), rng.uniform(0.1, 1.0, (2, *INFERRED_SHAPE))
    every = list(np.ndindex(INFERRED_SHAPE))
    detected = {view: float(quality[0][view]) for view in every if kind[view] == 1}
    missed = {view: float(quality[0][view]) for view in every if kind[view] in {2, 3}}
    inferred = {view: float(quality[1][view]) for view in every if kind[view] in {3, 4}}
    frames, cameras, people, qualities = (np.array(side) for side in columns(detected | missed))
    available = np.ones(INFERRED_SHAPE[:2], dtype=np.bool_)
    views = VisibleViews(frames, cameras, people, qualities, available, PEOPLE, detected_count=len(detected))
    frame, camera, person, extra = (np.array(side) for side in columns(inferred))
    views = add_inferred_views(
        views, frame.astype(int), camera.astype(int), person.astype(int), extra.astype(float)
    )
    by_view = quality_by_view(views)
    assert dict(list(by_view.items())[: views.detected_count]) == detected
    larger = {view: max(missed.get(view, 0.0), inferred.get(view, 0.0)) for view in missed | inferred}
    assert by_view == detected | larger
