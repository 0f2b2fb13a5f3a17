"""What is told about a decision: cuts, and what turned out about numbers."""

from __future__ import annotations

from typing import cast

from bestview import Merge, Split
from server.view.board import Board
from server.view.decide import GopDecision, ObjectChoice
from server.view.why import Why
from server.wire.messages import Cut, Merged, Parted

_UNTOLD = cast("Why", None)


def test_a_decision_is_told_with_its_cuts_and_corrections() -> None:
    choices = (ObjectChoice(1, "c1", "c0", away=False), ObjectChoice(2, "c0", "c0", away=False))
    turned_out = (Merge(kept=1, lost=5), Split(kept=2, parted=3, camera="c1"))
    told = Board().put(GopDecision(20, 10, choices, {"c0": [], "c1": []}, {5: 1}, turned_out, _UNTOLD))
    assert told.choices == {1: "c1", 2: "c0"}
    assert told.cuts == [Cut(object=1, pulse=20, from_camera="c0", to_camera="c1")]
    assert told.merged == [Merged(kept=1, lost=5)]
    assert told.split == [Parted(kept=2, parted=3, camera="c1")]
