"""The box filter and the foreground fit equal references that sum cell by cell."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tracking.detectors.background.box_filter import BoxFilter, BoxFilterSettings, HeightRange, ScanPeaks
from tracking.detectors.background.foreground_fit import ForegroundFitSettings, GreedySearch, fit_foreground
from tracking.detectors.background.height_model import HeightModel
from tracking.detectors.background.silhouette import BODY_PARTS, Body, part_rectangles

ROWS, COLUMNS = 90, 120
Plane = npt.NDArray[np.float32]
PEOPLE = ((20.0, 30.0, 34.0, 67.0), (30.0, 28.0, 45.0, 67.0), (80.0, 40.0, 92.0, 72.0))


def body_of(box: npt.NDArray[np.float64], body: Body = "person") -> npt.NDArray[np.bool_]:
    """Draw the body of a box, part by part."""
    inside = np.zeros((ROWS, COLUMNS), dtype=np.bool_)
    width, height = box[2] - box[0], box[3] - box[1]
    for part in BODY_PARTS[body]:
        left, right = (max(round(box[0] + share * width), 0) for share in (part.left, part.right))
        top, bottom = (max(round(box[1] + share * height), 0) for share in (part.top, part.bottom))
        inside[top:bottom, left:right] = True
    return inside


def scene(seed: int = 0) -> tuple[Plane, Plane, Plane]:
    """Return foreground, cost and weight: three people, two of them overlapping, among noise."""
    rng = np.random.default_rng(seed)
    foreground = (rng.random((ROWS, COLUMNS)) < 0.03).astype(np.float32)
    for box in PEOPLE:
        foreground[body_of(np.array(box))] = 1.0
    weight = np.ones((ROWS, COLUMNS), dtype=np.float32)
    weight[:, :6] = 0.0
    cost = (0.35 * np.maximum(weight - foreground, 0.0)).astype(np.float32)
    return foreground * weight, cost, weight


def find_peaks(body: Body = "person", band: HeightRange | None = None) -> ScanPeaks:
    foreground, cost, weight = scene()
    settings = BoxFilterSettings(body=body, min_height=0.3, max_height=0.6)
    return BoxFilter(weight, ROWS, settings).peaks(foreground - cost, band)


@pytest.mark.parametrize("body", ["person", "box"])
def test_gains_and_areas_equal_sums_over_cells(body: Body) -> None:
    foreground, cost, weight = scene()
    peaks = find_peaks(body)
    assert len(peaks.boxes) > 3
    for box, gain, size in zip(peaks.boxes, peaks.gains, peaks.areas, strict=True):
        inside = body_of(box, body)
        assert gain == pytest.approx((foreground - cost)[inside].sum(), abs=1e-3)
        assert size == pytest.approx(max(weight[inside].sum(), 1.0))
    assert (np.diff(peaks.gains) <= 0.0).all()


def test_every_person_is_a_peak() -> None:
    best = find_peaks().boxes
    for box in PEOPLE:
        assert (np.abs(best - box).max(axis=1) <= 3.0).any(), box


def test_peaks_are_local_maxima() -> None:
    foreground, cost, _ = scene()
    gain = foreground - cost
    for box, value in zip(find_peaks().boxes[:3], find_peaks().gains[:3], strict=True):
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            assert gain[body_of(box + np.array([x, y, x, y]))].sum() <= 1.03 * value


def test_heights_outside_the_range_are_not_searched() -> None:
    line = HeightModel(slope=0.55, offset=0.0)
    peaks = find_peaks(band=HeightRange(line, tolerance=0.15, tolerance_std=1.0, min_height=0.08))
    heights, feet = peaks.boxes[:, 3] - peaks.boxes[:, 1], peaks.boxes[:, 3]
    assert len(heights) > 3
    assert (np.abs(heights - 0.55 * feet) <= np.maximum(0.15 * 0.55 * feet, 1.0)).all()
    assert ((peaks.gain_factors > 0.0) & (peaks.gain_factors <= 1.0)).all()


def test_small_people_are_searched_down_to_the_least_height_of_the_model() -> None:
    weight = np.ones((ROWS, COLUMNS), dtype=np.float32)
    gain = np.full_like(weight, -0.35)
    child = np.array([60.0, 30.0, 65.0, 42.0])
    gain[body_of(child)] = 1.0
    for smallest, expected in ((40.0, False), (11.0, True)):
        line = HeightModel(0.3, 0.0, min_height=smallest)
        one = BoxFilter(weight, ROWS, BoxFilterSettings(min_height=0.3))
        boxes = one.peaks(gain, HeightRange(line, 0.15, 1.0, min_height=0.08)).boxes
        assert (len(boxes) > 0) == expected
        assert not expected or np.abs(boxes[0] - child).max() <= 2.0


def test_a_new_height_range_replaces_the_previous_one() -> None:
    foreground, cost, weight = scene()
    one = BoxFilter(weight, ROWS, BoxFilterSettings(min_height=0.3, max_height=0.6))
    bands = [HeightRange(HeightModel(slope, 0.0), 0.1, 1.0, 0.08) for slope in (0.5, 0.6)]
    alternating = [one.peaks(foreground - cost, band).boxes for band in (*bands, None, bands[0])]
    np.testing.assert_array_equal(alternating[0], alternating[3])
    assert alternating[0].shape != alternating[1].shape or (alternating[0] != alternating[1]).any()


def test_incremental_gains_equal_recomputed_ones() -> None:
    foreground, cost, weight = scene()
    peaks = find_peaks()
    search = GreedySearch(peaks, foreground, cost, weight, ForegroundFitSettings())
    chosen: set[int] = set()
    rng = np.random.default_rng(1)
    for index in rng.integers(0, min(len(peaks.boxes), 12), 40).tolist():
        (search.remove if index in chosen else search.add)(index)
        chosen ^= {index}
        hidden = np.zeros((ROWS, COLUMNS), dtype=np.bool_)
        for one in chosen:
            hidden |= body_of(peaks.boxes[one])
        remaining = np.where(hidden, np.minimum(foreground - cost, 0.0), foreground - cost)
        free = np.where(hidden, 0.0, weight)
        bodies = [body_of(box) for box in peaks.boxes]
        np.testing.assert_allclose(search.gains, [remaining[body].sum() for body in bodies], atol=1e-2)
        np.testing.assert_allclose(search.visible, [free[body].sum() for body in bodies], atol=1e-2)


def test_a_small_set_explains_the_foreground_and_other_boxes_score_low() -> None:
    foreground, cost, weight = scene()
    explained = fit_foreground(find_peaks(), foreground, cost, weight, ForegroundFitSettings())
    assert explained.person_count == 3
    assert (explained.scores[:3] > 0.6).all()
    assert (explained.scores[3:] < 0.4).all()


def test_a_crowd_is_explained_by_its_number_of_people() -> None:
    weight = np.ones((ROWS, COLUMNS), dtype=np.float32)
    crowd = [
        (4.0 + 12.0 * k, 4.0 + 40.0 * row, 16.0 + 12.0 * k, 36.0 + 40.0 * row)
        for row in (0, 1)
        for k in range(9)
    ]
    foreground = np.zeros_like(weight)
    for box in crowd:
        foreground[body_of(np.array(box))] = 1.0
    cost = (0.35 * (1.0 - foreground)).astype(np.float32)
    peaks = BoxFilter(weight, ROWS, BoxFilterSettings(min_height=0.3, max_height=0.4)).peaks(
        foreground - cost, None
    )
    settings = ForegroundFitSettings()
    explained = fit_foreground(peaks, foreground, cost, weight, settings)
    assert explained.person_count == len(crowd) > settings.max_hypotheses
    assert explained.person_count < len(explained.boxes) <= len(crowd) + settings.max_alternatives
    assert (
        fit_foreground(peaks, foreground, cost, weight, ForegroundFitSettings(max_people=7)).person_count == 7
    )


def test_without_foreground_fit_boxes_score_independently() -> None:
    foreground, cost, weight = scene()
    peaks = find_peaks()
    explained = fit_foreground(
        peaks, foreground, cost, weight, ForegroundFitSettings(enabled=False, max_hypotheses=5)
    )
    assert len(explained.boxes) == 5 == explained.person_count
    np.testing.assert_array_equal(explained.boxes[0], peaks.boxes[0])
    assert explained.scores[0] == pytest.approx(peaks.gains[0] / peaks.areas[0])


def test_an_empty_foreground_has_no_peaks() -> None:
    _, _, weight = scene()
    nothing, cost = np.zeros_like(weight), 0.35 * weight
    peaks = BoxFilter(weight, ROWS, BoxFilterSettings()).peaks(nothing - cost, None)
    assert len(peaks.boxes) == 0
    assert len(fit_foreground(peaks, nothing, cost, weight, ForegroundFitSettings()).boxes) == 0


def test_bodies_are_clipped_at_the_borders() -> None:
    boxes = np.array([[-10.0, -10.0, 10.0, 40.0], [110.0, 60.0, 130.0, 120.0]])
    corners = part_rectangles(boxes, BODY_PARTS["box"], (ROWS, COLUMNS))
    sums = np.arange(ROWS + 1)[:, None] * np.arange(COLUMNS + 1.0)[None]  # the integral of a plane of ones
    np.testing.assert_allclose(corners.sums(sums), [10 * 40, 10 * 30])
