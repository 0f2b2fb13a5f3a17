"""Who is pointed at where the detector finds one box for two is there all the same."""

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
    pointing = PositionCorrection(0, 1, 100.0, 50.0, 8.0)
    own, both, far = [92.0, 30.0, 112.0, 70.0], [85.0, 30.0, 125.0, 70.0], [150.0, 30.0, 170.0, 70.0]
    assert has_hypothesis(pointing, SIZE, np.array([far, own]))
    assert not has_hypothesis(pointing, SIZE, np.array([far, both]))
    assert not has_hypothesis(pointing, SIZE, np.empty((0, 4)))


def test_an_inserted_detection_comes_last_with_score_0() -> None:
    seen = Detections(np.array([[0.0, 0, 9, 9]]), np.array([0.9]), np.array([[0.5, 0.5]]))
    more = insert_hypothesis(seen, np.array([1.0, 2, 3, 4]), np.array([1.0, 0.0]))
    assert more.boxes.tolist() == [[0.0, 0, 9, 9], [1.0, 2, 3, 4]]
    assert more.scores.tolist() == [0.9, 0.0]
    assert more.histograms.tolist() == [[0.5, 0.5], [1.0, 0.0]]


def test_an_inserted_hypothesis_is_for_its_object_only_and_conflicts_with_none() -> None:
    """In the middle frame both would be at the same observation, and one would have to hide."""
    network = network_of(
        Case(2, 3, 2, shared=True, settings=replace(SETTINGS, layout=0.0, gate=None), seed=5)
    )
    conflicts = network.conflicts.copy()
    conflicts[1] = True
    network = replace(network, conflicts=conflicts)
    made = apply_insertions(network, 10, [7, 8], {11: {8: 1}}, change=0.3)
    assert np.isinf(made.node[0, 1, 1])
    np.testing.assert_array_equal(made.node[1], network.node[1])
    assert made.conflicts[1].tolist() == [[True, False], [False, True]]
    states = create_solver("exact").solve(made).states
    assert states[0, 1] in {0, OCCLUDED}
    assert apply_insertions(network, 10, [7, 8], {20: {8: 1}}, change=0.3) is network
