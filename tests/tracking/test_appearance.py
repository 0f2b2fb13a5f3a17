"""Histograms and their distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.appearance import AppearanceMeasure, appearance_distance_matrix, gray_histograms

MEASURES: list[AppearanceMeasure] = ["bhattacharyya", "intersection"]


def test_each_box_has_the_histogram_of_its_pixels() -> None:
    gray = np.zeros((10, 20), dtype=np.uint8)
    gray[:, 10:] = 255
    found = gray_histograms(gray, np.array([[0.0, 0, 10, 10], [10.0, 0, 20, 10], [5.0, 0, 15, 10]]), bins=4)
    np.testing.assert_allclose(found, [[1, 0, 0, 0], [0, 0, 0, 1], [0.5, 0, 0, 0.5]])


def test_boxes_are_clipped_to_the_image_and_a_box_outside_has_the_uniform_histogram() -> None:
    gray = np.full((10, 10), 200, dtype=np.uint8)
    found = gray_histograms(gray, np.array([[-5.0, -5, 5, 5], [50.0, 50, 60, 60]]), bins=2)
    np.testing.assert_allclose(found, [[0.0, 1.0], [0.5, 0.5]])


def test_a_mask_leaves_only_its_pixels() -> None:
    gray = np.zeros((4, 4), dtype=np.uint8)
    gray[0] = 255
    mask = np.zeros_like(gray)
    mask[0] = 1
    found = gray_histograms(gray, np.array([[0.0, 0, 4, 4]]), bins=2, mask=mask)
    np.testing.assert_allclose(found, [[0.0, 1.0]])


@pytest.mark.parametrize("bins", [0, 257])
def test_impossible_bins_are_refused(bins: int) -> None:
    with pytest.raises(ValueError, match="between 1 and 256"):
        gray_histograms(np.zeros((2, 2), dtype=np.uint8), np.zeros((0, 4)), bins=bins)


@pytest.mark.parametrize("measure", MEASURES)
@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_distances_range_from_identical_to_disjoint(measure: AppearanceMeasure, seed: int) -> None:
    histograms = np.random.default_rng(seed).dirichlet(np.ones(8), 5)
    table = appearance_distance_matrix(histograms, histograms, measure)
    assert table.shape == (5, 5)
    np.testing.assert_allclose(table.diagonal(), 0.0, atol=1e-7)
    np.testing.assert_allclose(table, table.T)
    assert ((table >= 0.0) & (table <= 1.0)).all()
    apart = appearance_distance_matrix(np.eye(2)[:1], np.eye(2)[1:], measure)
    np.testing.assert_allclose(apart, 1.0)


@pytest.mark.parametrize("measure", MEASURES)
def test_unknown_appearances_have_distance_zero(measure: AppearanceMeasure) -> None:
    assert (appearance_distance_matrix(np.empty((2, 0)), np.empty((3, 0)), measure) == np.zeros((2, 3))).all()
