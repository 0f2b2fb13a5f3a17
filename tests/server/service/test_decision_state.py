"""The published decision: cuts, and merged and split numbers."""

from __future__ import annotations

from typing import cast

from bestview import Merge, Split
from server.messaging.messages import PersonMerge, PersonSplit, ViewCut
from server.service.decision_state import DecisionState
from server.service.view_selection.decider import GopDecision, ObjectChoice
from server.service.view_selection.explanation import GopExplanation, ViewCostExplanation

_UNTOLD = cast("GopExplanation", None)


class Counted:
    """Selection reasons that count queries."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def of(self, number: int) -> ViewCostExplanation:
        self.asked.append(number)
        return ViewCostExplanation(25, {}, {}, None, None, None, float(number))


def test_a_decision_is_published_with_its_cuts_and_corrections() -> None:
    choices = (ObjectChoice(1, "c1", "c0", departed=False), ObjectChoice(2, "c0", "c0", departed=False))
    turned_out = (Merge(kept=1, lost=5), Split(published_id=2, corrected_id=3, camera="c1"))
    message = DecisionState(25.0).put(
        GopDecision(20, 10, choices, {"c0": [], "c1": []}, {5: 1}, turned_out, _UNTOLD)
    )
    assert message.choices == {1: "c1", 2: "c0"}
    assert message.cuts == [ViewCut(object=1, pulse=20, from_camera="c0", to_camera="c1")]
    assert message.merged == [PersonMerge(kept=1, lost=5)]
    assert message.split == [PersonSplit(kept=2, new_object=3, camera="c1")]


def decided(state: DecisionState, first: int, numbers: tuple[int, ...] = (1, 2)) -> Counted:
    """Add a GOP of ten frames; return its reasons."""
    choices = tuple(ObjectChoice(number, "c0", "c0", departed=False) for number in numbers)
    why = Counted()
    state.put(GopDecision(first, 10, choices, {}, {7: 1}, (), cast("GopExplanation", why)))
    return why


def test_no_reasons_are_kept_without_queries() -> None:
    state = DecisionState(25.0)
    assert all(decided(state, first).asked == [] for first in range(0, 500, 10))
    assert state.explain(9) is None
    assert state.explain(2, 480) is None, "before the first query"


def test_reasons_are_kept_for_a_minute_from_the_first_query_on() -> None:
    state = DecisionState(25.0)
    whys = [decided(state, 0)]
    for first in range(10, 4000, 10):
        newest = state.explain(7 if first % 20 else 1)
        assert newest is not None
        assert newest.view.first == first - 10
        whys.append(decided(state, first))
    assert all(why.asked == [1] for why in whys)
    assert state.explain(1, 3990 - 60 * 25) is not None
    assert state.explain(1, 3990 - 70 * 25) is None
    for pulse in (3990, 3985, 3000):
        then = state.explain(1, pulse)
        assert then is not None
        assert then.view.first == pulse - pulse % 10
    assert state.explain(1, 4000) is None, "not decided yet"


def test_reasons_expire_without_queries() -> None:
    state = DecisionState(25.0)
    decided(state, 0)
    state.explain(1)
    counts = [decided(state, first).asked for first in range(10, 2000, 10)]
    assert counts.index([]) == 75, "half a minute later"
    assert not any(counts[75:])
    assert state.explain(1, 500) is None


def test_reasons_are_discarded_when_pulses_start_again() -> None:
    state = DecisionState(25.0)
    decided(state, 1000)
    state.explain(1)
    decided(state, 1010)
    decided(state, 0)
    assert state.explain(1, 1015) is None
    assert state.explain(1, 5) is not None


def test_a_departed_person_has_no_explanation() -> None:
    state = DecisionState(25.0)
    decided(state, 0)
    state.explain(2)
    decided(state, 10, (1,))
    assert state.explain(2) is None
