"""Costs of positions that contradict an operator's correction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import SETTINGS, Case, cases, network_of
from tracking.interactive import InteractiveSettings, PositionCorrection
from tracking.interactive.corrections import apply_corrections, normalized_squared_distance
from tracking.solvers.base import create_solver

ASSIST = InteractiveSettings(enabled=True)


def test_the_normalized_squared_distance_is_0_at_the_middle_of_a_box_and_at_most_1() -> None:
    boxes = np.array(
        [[0.0, 0.0, 20.0, 40.0], [20.0, 0.0, 40.0, 40.0], [40.0, 0.0, 60.0, 40.0], [400.0, 0, 420, 40]]
    )
    np.testing.assert_allclose(
        normalized_squared_distance(PositionCorrection(0, 1, 10.0, 20.0, 20.0), boxes), [0.0, 0.25, 1.0, 1.0]
    )


@pytest.mark.parametrize("wrong", [(np.nan, 0.0, 1.0), (0.0, np.inf, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
def test_a_correction_without_finite_position_or_tolerance_is_refused(
    wrong: tuple[float, float, float],
) -> None:
    with pytest.raises(ValueError, match="finite coordinates and a positive tolerance"):
        PositionCorrection(0, 1, *wrong)


@given(cases(objects=3, frames=4, places=4), st.integers(0, 3), st.floats(-20, 140), st.floats(-20, 140))
@settings(deadline=None, max_examples=40)
def test_a_correction_raises_only_node_costs_of_its_object_in_its_frame(
    case: Case, frame: int, x: float, y: float
) -> None:
    network = network_of(replace(case, shared=True))
    correction = PositionCorrection(100 + frame, 7, x, y, 25.0)
    ids = [7, *range(10, 9 + network.objects)]
    changed = apply_corrections(network, 100, ids, {correction.frame: {7: correction}}, ASSIST, 1.5)
    if frame >= network.frames:
        assert changed is network
        return
    more = network.node.copy()
    more[0, frame, :-1] += ASSIST.correction_weight * normalized_squared_distance(
        correction, network.boxes[0, frame]
    )
    more[0, frame, -1] += ASSIST.correction_weight * ASSIST.hidden_share
    np.testing.assert_array_equal(changed.node, more)
    for before, after in ((network.source, changed.source), (network.pair, changed.pair)):
        assert ((before == after) | (np.isinf(before) & (after == 1.5))).all()


def test_a_correction_decides_between_two_identical_objects() -> None:
    """Both objects are identical before the window: without the correction the assignment is arbitrary."""
    case = Case(2, 3, 2, shared=True, settings=replace(SETTINGS, layout=0.0, gate=None), seed=5)
    network = network_of(case)
    even = replace(network, node=np.zeros_like(network.node), source=np.zeros_like(network.source))
    places = [np.flatnonzero(network.present[0, m]) for m in range(3)]
    assert all(len(frame_places) == 2 for frame_places in places)
    for owner in (0, 1):
        left, top, right, bottom = network.boxes[0, 2, 0].tolist()
        correction = PositionCorrection(2, owner, (left + right) / 2.0, (top + bottom) / 2.0, 1.0)
        corrected = apply_corrections(even, 0, [0, 1], {2: {owner: correction}}, ASSIST, 1.0)
        states = create_solver("exact").solve(corrected).states
        assert states[owner, 2] == 0
