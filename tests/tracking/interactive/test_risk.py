"""Failure probabilities from risk features."""

from __future__ import annotations

from itertools import pairwise
from typing import get_args

import numpy as np
import pytest

from benchmarks.operator_assist.risk_weights import fit_weights
from tracking.interactive import RiskFeatures, RiskReason
from tracking.interactive.risk import WEIGHTS, failure_probability


@pytest.mark.parametrize("reason", get_args(RiskReason))
def test_a_risk_is_a_probability_and_falls_with_the_margin(reason: RiskReason) -> None:
    for lead in (-20.0, 0.0, 20.0):
        risks = [
            failure_probability(reason, RiskFeatures(margin, lead, 10.0))
            for margin in (0.0, 0.5, 2.0, 100.0, np.inf)
        ]
        assert all(0.0 < risk < 1.0 for risk in risks)
        assert all(one >= other for one, other in pairwise(risks))


def test_the_risk_of_track_loss_grows_with_the_hidden_time() -> None:
    risks = [
        failure_probability("track_loss", RiskFeatures(0.0, -hidden, hidden)) for hidden in (5, 10, 20, 40)
    ]
    assert all(one < other for one, other in pairwise(risks))


def test_fitting_recovers_the_weights_that_generated_the_examples() -> None:
    rng = np.random.default_rng(1)
    truth = np.array([-1.0, 2.0])
    terms = np.stack([np.ones(20_000), rng.normal(size=20_000)], axis=1)
    wrong = rng.random(20_000) < 1.0 / (1.0 + np.exp(-(terms @ truth)))
    np.testing.assert_allclose(fit_weights(terms, wrong.astype(np.float64)), truth, atol=0.1)


def test_every_reason_has_weights() -> None:
    assert set(WEIGHTS) == set(get_args(RiskReason))
