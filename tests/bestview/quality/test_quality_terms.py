"""The terms of view quality, and their weighted product."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import QualitySettings, size_quality
from bestview.quality import (
    CameraLayout,
    TrackWindow,
    compute_view_quality,
    relative_quality,
    relative_view_quality,
    view_cost,
)
from bestview.quality.facing import facing_score
from bestview.quality.framing import centering_score, untruncated_share
from bestview.quality.occlusion import occlusion_score

WIDTH, HEIGHT, FPS = 100.0, 80.0, 25.0
PICTURE = np.array([0.0, 0.0, WIDTH, HEIGHT])
FLOOR = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
"""A camera that looks straight down: a pixel is a unit of ground, down the picture is towards it."""


def box(left: float, top: float, width: float = 10.0, height: float = 40.0) -> list[float]:
    return [left, top, left + width, top + height]


def walk(x: float, y: float, frames: int = 15) -> NDArray[np.float64]:
    """Return the boxes (1, N, 4) of one person who moves by (x, y) pixels a frame."""
    steps = np.arange(frames)[:, None] * np.array([x, y, x, y])
    return np.array([box(50, 200)]) + steps[None]


def layout_of(*homographies: NDArray[np.float64] | None) -> CameraLayout:
    cameras = homographies or (None,)
    return CameraLayout((WIDTH, HEIGHT), np.tile(PICTURE, (len(cameras), 1)), cameras, FPS)


def tracks_of(boxes: NDArray[np.float64], confidence: float = 1.0, sharpness: float = np.nan) -> TrackWindow:
    """Return a window of tracks of camera 0."""
    tracks = len(boxes)
    return TrackWindow(
        boxes, np.zeros(tracks, dtype=np.int64), np.full(tracks, confidence), np.full(tracks, sharpness)
    )


def only(**weights: float) -> QualitySettings:
    nothing = dict.fromkeys(QualitySettings().weights, 0.0)
    return QualitySettings(**{**nothing, **weights})


def test_a_box_clear_of_all_edges_is_not_truncated() -> None:
    boxes = np.array([box(20, 20), box(-5, 20), box(20, 40), box(20, 0), box(20, 60), box(200, 20)])
    assert untruncated_share(boxes, PICTURE) == pytest.approx([1.0, 0.5, 0.95, 0.95, 0.475, 0.0])


def test_truncation_grows_gradually_towards_an_edge() -> None:
    values = untruncated_share(np.array([box(20, 40 - gap) for gap in (0.0, 0.3, 0.6, 1.2, 5.0)]), PICTURE)
    assert values == pytest.approx([0.95, 0.9625, 0.975, 1.0, 1.0])


def test_a_slim_box_at_a_side_edge_is_truncated_by_its_width() -> None:
    slim, wide = 0.37 * 40.0 / 2.0, 0.37 * 40.0
    boxes = np.array([box(0, 20, slim), box(WIDTH - slim, 20, slim), box(0, 20, wide), box(0, 20, 2 * wide)])
    assert untruncated_share(boxes, PICTURE) == pytest.approx([0.5, 0.5, 1.0, 1.0])
    away = np.array([box(gap, 20, slim) for gap in (0.0, 0.6, 1.2, 30.0)])
    assert untruncated_share(away, PICTURE) == pytest.approx([0.5, 0.75, 1.0, 1.0]), (
        "away from the edge a slim box is complete"
    )
    beyond = np.array([box(-slim / 2, 20, slim), box(WIDTH - slim / 2, 20, slim)])
    assert untruncated_share(beyond, PICTURE) == pytest.approx([0.5, 0.5]), (
        "the area outside counts only once"
    )


def test_centering_is_one_in_the_middle() -> None:
    boxes = np.array([box(45, 20), [-5.0, -20.0, 5.0, 20.0], [20.0, 20.0, 30.0, 60.0]])
    assert centering_score(boxes, PICTURE) == pytest.approx([1.0, 0.0, 1 - 25 / np.hypot(50, 40)])


def unoccluded(*boxes: list[float], cameras: tuple[int, ...] | None = None) -> list[float]:
    """Return the visible share of each box in one frame, by default all in one picture."""
    camera_of = np.array(cameras or [0] * len(boxes), dtype=np.int64)
    return [float(share) for share in occlusion_score(np.array(boxes)[:, None], camera_of)[:, 0]]


def test_the_person_with_lower_feet_occludes_the_other() -> None:
    near, far = box(20, 30), box(22, 20, 10, 40)
    assert unoccluded(near, far) == pytest.approx([1.0, 2 * (1 - 8 * 30 / 400)])
    assert unoccluded(near, far, cameras=(0, 1)) == [1.0, 1.0], "in different pictures"


def test_half_a_visible_box_scores_one_and_none_scores_zero() -> None:
    half, covering = box(25, 30), box(20, 30)
    behind = box(20, 20, 10, 40)
    assert unoccluded(behind, half) == [1.0, 1.0]
    assert unoccluded(behind, [15, 10, 35, 80]) == [0.0, 1.0]
    assert unoccluded(behind, covering)[0] == pytest.approx(2 * 0.25)


def test_at_equal_distance_both_people_are_half_occluded() -> None:
    assert unoccluded(box(20, 20), box(20, 20)) == [1.0, 1.0], "half of each box may be covered"


BOX = st.tuples(
    *(st.integers(0, 30).map(float) for _ in "xy"), *(st.integers(0, 20).map(float) for _ in "wh")
).map(lambda sides: box(*sides))
TRACKS = st.lists(
    st.tuples(st.integers(0, 2), st.lists(BOX | st.just([np.nan] * 4), min_size=3, max_size=3)), max_size=9
)


def reference_occlusion(boxes: NDArray[np.float64], cameras: NDArray[np.int64]) -> NDArray[np.float64]:
    """Compute the occlusion pair by pair."""
    values = np.ones(boxes.shape[:2])
    for i, n in np.ndindex(*values.shape):
        visible, a = 1.0, boxes[i, n]
        for j, b in enumerate(boxes[:, n]):
            width = min(a[2], b[2]) - max(a[0], b[0])
            height = min(a[3], b[3]) - max(a[1], b[1])
            if i == j or cameras[i] != cameras[j] or np.isnan([a, b]).any() or width <= 0 or height <= 0:
                continue
            lower = (b[3] - a[3]) / max(a[3] - a[1], b[3] - b[1])
            nearer = min(max(0.5 + lower / 0.1, 0.0), 1.0)
            if j < i:  # computed from the lower index, as in the implementation
                nearer = 1.0 - min(max(0.5 + (a[3] - b[3]) / max(a[3] - a[1], b[3] - b[1]) / 0.1, 0.0), 1.0)
            visible *= 1.0 - nearer * (width * height / ((a[3] - a[1]) * (a[2] - a[0])))
        values[i, n] = min(visible / 0.5, 1.0)
    return values


@settings(deadline=None, max_examples=150)
@given(TRACKS)
def test_occlusion_equals_the_reference(
    tracks: list[tuple[int, list[list[float]]]],
) -> None:
    cameras = np.array([camera for camera, _ in tracks], dtype=np.int64)
    boxes = np.array([boxes for _, boxes in tracks]).reshape(-1, 3, 4)
    assert occlusion_score(boxes, cameras).tolist() == reference_occlusion(boxes, cameras).tolist(), (
        "to the bit"
    )


def test_walking_towards_the_camera_scores_one_and_away_zero() -> None:
    towards, away, across, standing = (
        facing_score(walk(*step), FLOOR, FPS)[0] for step in ((0.0, 3.0), (0.0, -3.0), (3.0, 0.0), (0.0, 0.0))
    )
    assert towards > 0.9
    assert away == pytest.approx(1 - towards)
    assert (across, standing) == (pytest.approx(0.5), pytest.approx(0.5))


def test_slow_walking_counts_less_and_hidden_frames_do_not_count() -> None:
    slow, fast = (facing_score(walk(0.0, speed), FLOOR, FPS)[0] for speed in (0.2, 2.0))
    assert 0.5 < slow < fast < 1.0
    gaps = walk(0.0, 2.0)
    gaps[0, 3:9] = np.nan
    assert facing_score(gaps, FLOOR, FPS)[0] == pytest.approx(fast)
    assert facing_score(np.full((2, 15, 4), np.nan), FLOOR, FPS).tolist() == [0.5, 0.5]


def test_the_direction_towards_the_camera_comes_from_the_ground() -> None:
    turned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert facing_score(walk(0.0, 3.0), turned, FPS)[0] == facing_score(walk(0.0, 3.0), FLOOR, FPS)[0]


def test_size_alone_without_relative_costs_is_the_papers_quality() -> None:
    boxes = np.random.default_rng(1).uniform(0, 80, (3, 4, 4))
    boxes[..., 2:] += boxes[..., :2]
    found = compute_view_quality(tracks_of(boxes), layout_of(None, None), only(size=1.0))
    assert found.term_names == ("size",)
    np.testing.assert_allclose(found.quality, size_quality(boxes, WIDTH, HEIGHT))


WEIGHTS = st.fixed_dictionaries({name: st.floats(0, 1) for name in QualitySettings().weights})


@settings(deadline=None, max_examples=60)
@given(WEIGHTS, st.integers(0, 2**32 - 1))
def test_quality_is_the_product_of_the_weighted_terms(weights: dict[str, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = rng.uniform(-20, 90, (6, 5, 4))
    boxes[..., 2:] = boxes[..., :2] + rng.uniform(1, 60, (6, 5, 2))
    boxes[rng.random((6, 5)) < 0.3] = np.nan
    terms = QualitySettings(**{**weights, "size": 1.0})
    tracks = TrackWindow(boxes, rng.integers(0, 2, 6), rng.random(6), rng.random(6))
    found = compute_view_quality(tracks, layout_of(FLOOR, None), terms)
    there = ~np.isnan(boxes[..., 0])
    expected = np.ones(there.shape)
    for name, term in zip(found.term_names, found.terms, strict=True):
        assert ((term[there] >= 0) & (term[there] <= 1)).all(), name
        assert np.isnan(term[~there]).all()
        expected *= 1 - terms.weights[name] * (1 - term)
    np.testing.assert_allclose(found.quality[there], expected[there])
    assert np.isnan(found.quality[~there]).all()
    assert set(found.term_names) == {name for name, weight in terms.weights.items() if weight > 0}


def test_unmeasured_sharpness_counts_as_one_and_low_confidence_lowers_quality() -> None:
    boxes = np.array(box(20, 20)).reshape(1, 1, 4)
    assert compute_view_quality(tracks_of(boxes), layout_of(), only(sharpness=1.0)).quality.item() == 1.0
    assert compute_view_quality(
        tracks_of(boxes, sharpness=0.4), layout_of(), only(sharpness=0.5)
    ).quality.item() == pytest.approx(0.7)
    assert compute_view_quality(
        tracks_of(boxes, confidence=0.4), layout_of(), only(confidence=1.0)
    ).quality.item() == pytest.approx(0.4)


def test_relative_quality_compares_with_the_best_view_of_the_frame() -> None:
    quality = np.array([[[0.1, 0.2], [0.0, 0.0]]])
    assert relative_quality(quality, axis=2).tolist() == [[[0.5, 1.0], [0.0, 0.0]]]
    assert view_cost(relative_quality(quality, axis=2)).tolist() == [[[0.5, 0.0], [1.0, 1.0]]]


def test_relative_quality_of_a_list_of_views_is_the_same() -> None:
    quality = np.round(np.random.default_rng(2).uniform(-0.5, 1, (4, 6, 3)), 1).clip(0)
    moment = np.arange(24).repeat(3)
    assert (
        relative_view_quality(quality.reshape(-1), moment, 24).tolist()
        == relative_quality(quality, 2).reshape(-1).tolist()
    )


def test_invalid_weights_and_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"facing is a share between 0 and 1, not 1\.5"):
        QualitySettings(facing=1.5)
    with pytest.raises(ValueError, match="all weights are 0"):
        only()
    camera = np.zeros(2, dtype=np.int64)
    with pytest.raises(ValueError, match="boxes have shape"):
        compute_view_quality(tracks_of(np.zeros((1, 2))), layout_of(), QualitySettings())
    with pytest.raises(ValueError, match="confidence has shape"):
        compute_view_quality(
            TrackWindow(np.zeros((2, 1, 4)), camera, np.ones(1), np.ones(2)), layout_of(), QualitySettings()
        )
    with pytest.raises(ValueError, match=r"a camera outside 0 \.\. 0"):
        compute_view_quality(
            TrackWindow(np.zeros((2, 1, 4)), camera + 1, np.ones(2), np.ones(2)),
            layout_of(),
            QualitySettings(),
        )
