"""Probability of an identity failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tracking.types import RiskReason

_MAX_MARGIN = 10.0
"""A margin from which more of it tells nothing."""
_LEAD_SCALE = 10.0
"""Frames that what is ahead is counted in."""


@dataclass(frozen=True, slots=True)
class RiskFeatures:
    """Features of the risk model.

    Attributes:
        margin: what it would cost the tracker to see it the other way.
        lead: frames from the newest one to when it is expected; negative: so long ago.
        length: frames for which the two are in each other's way, or somebody is hidden.
    """

    margin: float
    lead: float
    length: float

    @property
    def regression_terms(self) -> tuple[float, float, float, float, float]:
        """The terms of the log odds: a constant, the margin, and what is ahead and what has begun apart."""
        ahead = float(self.lead > 0.0)
        begun = math.log1p(self.length) * (1.0 - ahead)
        return 1.0, min(self.margin, _MAX_MARGIN), ahead, ahead * self.lead / _LEAD_SCALE, begun


WEIGHTS: Mapping[RiskReason, tuple[float, float, float, float, float]] = {
    "id_switch": (-0.50, -0.84, 0.00, 0.00, 0.26),
    "crossing": (-2.40, -0.02, 0.45, -0.08, 0.48),
    "track_loss": (-4.71, -0.02, -0.05, -0.12, 1.23),
    "optimality_gap": (-3.00, -1.00, 0.00, 0.00, 0.00),
}
"""By reason; learned by `python -m benchmarks.operator_assist.risk_weights`, except for `optimality_gap`:
the default solver proves its answers, so there are no examples of it. Its weights are a guess: at most
one in twenty, and less the larger the margin."""


def failure_probability(reason: RiskReason, signs: RiskFeatures) -> float:
    """Return the probability of an identity failure, by logistic regression."""
    odds = sum(weight * term for weight, term in zip(WEIGHTS[reason], signs.regression_terms, strict=True))
    return 1.0 / (1.0 + math.exp(-odds))
