"""Flags are raised for the likeliest failures."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from server.config.sections import FlagSettings
from server.service.operator_assist.flag_budget import FlagBudget

FPS = 25.0
MINUTE = round(60 * FPS)
SAME, OTHER, LATE = frozenset({1, 2}), frozenset({3, 4}), frozenset({5, 6})


def raised(per_minute: int, risks: list[tuple[int, int, float]]) -> list[int]:
    """Return the pulses of raised flags for risks (pulse, person, risk)."""
    budget, flagged = FlagBudget(FlagSettings(per_minute=per_minute, risk=0.0), FPS), []
    for now, person, risk in risks:
        people = frozenset({2 * person, 2 * person + 1})
        budget.record_risk(now, people, risk)
        if budget.is_worth_flag(now, people, risk):
            budget.record_flag(now, people)
            flagged.append(now)
    return flagged


@given(
    st.integers(0, 4),
    st.lists(st.tuples(st.integers(0, 900), st.integers(0, 5), st.floats(0, 1)), max_size=80),
)
def test_flags_are_limited_by_the_rate_and_the_saved_budget(
    per_minute: int, steps: list[tuple[int, int, float]]
) -> None:
    now, risks = 0, []
    for pause, person, risk in steps:
        now += pause
        risks.append((now, person, risk))
    flags = raised(per_minute, risks)
    for n, first in enumerate(flags):
        for k, last in enumerate(flags[n:], 1):
            assert k <= per_minute * (3 + (last - first) / MINUTE) + 1e-6


def test_of_many_risks_the_likeliest_failures_are_flagged() -> None:
    """Thirty risks a minute, two of them high; random flags would hit one in fifteen."""
    rng = np.random.default_rng(3)
    risks = []
    for n in range(30 * 20):
        is_high = n % 15 == rng.integers(15)
        risks.append((n * MINUTE // 30, n, 0.6 + 0.2 * rng.random() if is_high else 0.3 * rng.random()))
    flags = set(raised(2, risks))
    risky = [now for now, _, risk in risks if risk >= 0.6 and now > 2 * MINUTE]
    assert sum(now in flags for now in risky) > 0.6 * len(risky)


def test_a_lasting_risk_does_not_use_up_the_flags() -> None:
    """Two people are at low risk for three hours; once a minute others are at high risk."""
    hours, risks, rng = 3, [], np.random.default_rng(5)
    for second in range(hours * 3600):
        risks.append((second * round(FPS), 0, 0.2))
        if second % 60 == 30:
            risks.append((second * round(FPS), 1 + second, 0.5 + 0.5 * float(rng.random())))
    flags = raised(2, risks)
    risky = [now for now, person, _ in risks if person]
    last = {pulse for pulse in risky if pulse > (hours - 1) * 60 * MINUTE}
    assert len(last & set(flags)) >= 0.9 * len(last)


def test_scaling_all_risks_changes_no_flags() -> None:
    rng = np.random.default_rng(4)
    risks = [(n * 100, n, float(rng.random())) for n in range(200)]
    assert raised(3, risks) == raised(3, [(now, person, risk / 50) for now, person, risk in risks])


def test_a_repeated_risk_counts_once() -> None:
    """Otherwise one long risk would make all others look rare."""
    budget = FlagBudget(FlagSettings(per_minute=1, risk=0.0), FPS)
    for now in range(0, 40, 5):
        budget.record_risk(now, SAME, 0.9)
    budget.record_risk(45, OTHER, 0.5)
    assert not budget.is_worth_flag(45, OTHER, 0.5)
    assert budget.is_worth_flag(45, SAME, 0.9)
    budget.record_risk(3 * MINUTE, LATE, 0.5)
    assert budget.is_worth_flag(3 * MINUTE, LATE, 0.5), "the budget is saved"


def test_a_risk_below_the_threshold_is_never_flagged() -> None:
    budget = FlagBudget(FlagSettings(per_minute=5, risk=0.25), FPS)
    budget.record_risk(10, SAME, 0.24)
    assert not budget.is_worth_flag(10, SAME, 0.24)
    assert budget.is_worth_flag(10, SAME, 0.25)


def test_a_person_has_at_most_one_flag_for_some_seconds() -> None:
    budget = FlagBudget(FlagSettings(per_minute=5, risk=0.0), FPS)
    budget.record_flag(10, frozenset({1, 2}))
    assert not budget.is_worth_flag(12, frozenset({2, 3}), 0.9)
    assert budget.is_worth_flag(12, frozenset({3, 4}), 0.9)
    assert budget.is_worth_flag(10 + 5 * round(FPS), frozenset({2, 3}), 0.9)
