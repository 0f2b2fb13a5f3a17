"""The integer optimum: `exact` and `extended-dp` against each other and against trying everything."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from random_networks import Case, best_by_trying, cases, network_of

from tracking.detections import Detections
from tracking.network import Template, build_network
from tracking.presets import PAPER_COSTS
from tracking.solvers import solver_named

CLOSE = 1e-9
LAYOUTS = (0.0, 0.0, 0.0005, 0.002)


@pytest.mark.parametrize("name", ["exact", "extended-dp"])
@settings(deadline=None, max_examples=40)
@given(case=cases(objects=2, frames=3, places=2, layouts=LAYOUTS))
def test_the_optimum_is_found(name: str, case: Case) -> None:
    network = network_of(case)
    report = solver_named(name).solve(network).report
    assert report.objective == pytest.approx(best_by_trying(network), rel=CLOSE)
    assert (report.gap, report.conflicts, report.integral) == (0.0, 0, True)


@settings(deadline=None, max_examples=60)
@given(case=cases(objects=3, frames=5, places=4, layouts=(0.0, 0.0, 0.0005)))
def test_both_ways_to_the_optimum_agree(case: Case) -> None:
    network = network_of(case)
    joint = solver_named("extended-dp").solve(network).report
    exact = solver_named("exact").solve(network).report
    assert exact.objective == pytest.approx(joint.objective, rel=CLOSE)


@settings(deadline=None, max_examples=40)
@given(case=cases(objects=6, frames=5, places=8))
def test_the_optimum_lies_between_the_bound_and_the_rounded_states(case: Case) -> None:
    network = network_of(case)
    relaxed = solver_named("columns").solve(network).report
    exact = solver_named("exact").solve(network).report
    assert relaxed.bound - CLOSE <= exact.objective <= relaxed.objective + CLOSE


def test_too_many_joint_states_are_refused() -> None:
    seen = Detections(np.zeros((30, 4)), np.ones(30), np.ones((30, 1)))
    network = build_network([Template(n, np.ones(1), None) for n in range(5)], [seen], PAPER_COSTS)
    with pytest.raises(ValueError, match=r"5 objects in 30 places"):
        solver_named("extended-dp").solve(network)
