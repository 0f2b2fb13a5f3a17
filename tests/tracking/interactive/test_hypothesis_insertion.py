"""A corrected object gets an inserted box where the detector merges two people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fakes.tracking.random_networks import SETTINGS, Case, network_of
from tracking.interactive import PositionCorrection
from tracking.interactive.hypothesis_insertion import (
    apply_insertions,
    box_around,
    has_hypothesis,
    insert_hypothesis,
)
from tracking.solvers.base import OCCLUDED, create_solver
from tracking.types import Detections

SIZE = np.array([20.0, 40.0])


def test_an_inserted_box_has_the_objects_size_around_the_point() -> None:
    box = box_around(PositionCorrection(0, 1, 100.0, 50.0, 8.0), SIZE)
    np.testing.assert_allclose(box, [90.0, 30.0, 110.0, 70.0])


def test_only_a_box_of_the_objects_size_near_the_point_counts_as_its_hypothesis() -> None:
    correction = PositionCorrection(0, 1, 100.0, 50.0, 8.0)
    own, both, far = [92.0, 30.0, 112.0, 70.0], [85.0, 30.0, 125.0, 70.0], [150.0, 30.0, 170.0, 70.0]
    assert has_hypothesis(correction, SIZE, np.array([far, own]))
    assert not has_hypothesis(correction, SIZE, np.array([far, both]))
    assert not has_hypothesis(correction, SIZE, np.empty((0, 4)))


def test_an_inserted_detection_comes_last_with_score_0() -> None:
    seen = Detections(np.array([[0.0, 0, 9, 9]]), np.array([0.9]), np.array([[0.5, 0.5]]))
    extended = insert_hypothesis(seen, np.array([1.0, 2, 3, 4]), np.array([1.0, 0.0]))
    assert extended.boxes.tolist() == [[0.0, 0, 9, 9], [1.0, 2, 3, 4]]
    assert extended.scores.tolist() == [0.9, 0.0]
    assert extended.histograms.tolist() == [[0.5, 0.5], [1.0, 0.0]]


def test_an_inserted_hypothesis_is_for_its_object_only_and_conflicts_with_none() -> None:
    """In the middle frame both objects compete for one observation."""
    network = network_of(
        Case(2, 3, 2, shared=True, settings=replace(SETTINGS, layout=0.0, gate=None), seed=5)
    )
    conflicts = network.conflicts.copy()
    conflicts[1] = True
    network = replace(network, conflicts=conflicts)
    inserted = apply_insertions(network, 10, [7, 8], {11: {8: 1}}, change=0.3)
    assert np.isinf(inserted.node[0, 1, 1])
    np.testing.assert_array_equal(inserted.node[1], network.node[1])
    assert inserted.conflicts[1].tolist() == [[True, False], [False, True]]
    states = create_solver("exact").solve(inserted).states
    assert states[0, 1] in {0, OCCLUDED}
    assert apply_insertions(network, 10, [7, 8], {20: {8: 1}}, change=0.3) is network
