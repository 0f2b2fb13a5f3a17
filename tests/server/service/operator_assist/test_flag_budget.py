"""Flags are spent on what is likeliest to fail."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from server.config.sections import FlagSettings
from server.service.operator_assist.flag_budget import FlagBudget

FPS = 25.0
MINUTE = round(60 * FPS)
SAME, OTHER, LATE = frozenset({1, 2}), frozenset({3, 4}), frozenset({5, 6})


def raised(per_minute: int, told: list[tuple[int, int, float]]) -> list[int]:
    """Return when flags are raised for troubles of (pulse, who, risk)."""
    budget, found = FlagBudget(FlagSettings(per_minute=per_minute, risk=0.0), FPS), []
    for now, who, risk in told:
        people = frozenset({2 * who, 2 * who + 1})
        budget.record_risk(now, people, risk)
        if budget.is_worth_flag(now, people, risk):
            budget.record_flag(now, people)
            found.append(now)
    return found


@given(
    st.integers(0, 4),
    st.lists(st.tuples(st.integers(0, 900), st.integers(0, 5), st.floats(0, 1)), max_size=80),
)
def test_flags_are_as_many_a_minute_as_may_be_and_what_was_saved(
    per_minute: int, steps: list[tuple[int, int, float]]
) -> None:
    now, told = 0, []
    for pause, who, risk in steps:
        now += pause
        told.append((now, who, risk))
    flags = raised(per_minute, told)
    for n, first in enumerate(flags):
        for k, last in enumerate(flags[n:], 1):
            assert k <= per_minute * (3 + (last - first) / MINUTE) + 1e-6


def test_of_many_troubles_those_that_are_likelier_to_fail_have_the_flags() -> None:
    """Thirty a minute, of which two are very risky: chance would find one in fifteen of these."""
    rng = np.random.default_rng(3)
    told = []
    for n in range(30 * 20):
        bad = n % 15 == rng.integers(15)
        told.append((n * MINUTE // 30, n, 0.6 + 0.2 * rng.random() if bad else 0.3 * rng.random()))
    flags = set(raised(2, told))
    risky = [now for now, _, risk in told if risk >= 0.6 and now > 2 * MINUTE]
    assert sum(now in flags for now in risky) > 0.6 * len(risky)


def test_a_trouble_that_lasts_leaves_the_others_their_flags() -> None:
    """For three hours two people are in little trouble; once a minute others are in much more."""
    hours, told, rng = 3, [], np.random.default_rng(5)
    for second in range(hours * 3600):
        told.append((second * round(FPS), 0, 0.2))
        if second % 60 == 30:
            told.append((second * round(FPS), 1 + second, 0.5 + 0.5 * float(rng.random())))
    flags = raised(2, told)
    risky = [now for now, who, _ in told if who]
    last = {it for it in risky if it > (hours - 1) * 60 * MINUTE}
    assert len(last & set(flags)) >= 0.9 * len(last)


def test_risks_that_are_all_wrong_by_a_factor_change_nothing() -> None:
    rng = np.random.default_rng(4)
    told = [(n * 100, n, float(rng.random())) for n in range(200)]
    assert raised(3, told) == raised(3, [(now, who, risk / 50) for now, who, risk in told])


def test_what_is_told_again_and_again_counts_once() -> None:
    """Else one long trouble would make everything else look rare."""
    budget = FlagBudget(FlagSettings(per_minute=1, risk=0.0), FPS)
    for now in range(0, 40, 5):
        budget.record_risk(now, SAME, 0.9)
    budget.record_risk(45, OTHER, 0.5)
    assert not budget.is_worth_flag(45, OTHER, 0.5)
    assert budget.is_worth_flag(45, SAME, 0.9)
    budget.record_risk(3 * MINUTE, LATE, 0.5)
    assert budget.is_worth_flag(3 * MINUTE, LATE, 0.5), "one in the first minute leaves two for the others"


def test_what_is_not_likely_enough_is_worth_none_however_little_else_there_is() -> None:
    budget = FlagBudget(FlagSettings(per_minute=5, risk=0.25), FPS)
    budget.record_risk(10, SAME, 0.24)
    assert not budget.is_worth_flag(10, SAME, 0.24)
    assert budget.is_worth_flag(10, SAME, 0.25)


def test_for_some_seconds_nobody_has_two_flags() -> None:
    budget = FlagBudget(FlagSettings(per_minute=5, risk=0.0), FPS)
    budget.record_flag(10, frozenset({1, 2}))
    assert not budget.is_worth_flag(12, frozenset({2, 3}), 0.9)
    assert budget.is_worth_flag(12, frozenset({3, 4}), 0.9)
    assert budget.is_worth_flag(10 + 5 * round(FPS), frozenset({2, 3}), 0.9)
