"""What one window's answer tells the next one: objects are found again by number, frames by time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tracking.solvers.hint import Hint


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """The answer of a window.

    Attributes:
        first: the window's first frame.
        ids: the numbers of its objects, in the order of the hint.
        hint: the answer.
    """

    first: int
    ids: Sequence[int]
    hint: Hint

    def hint_for(self, first: int, ids: Sequence[int]) -> Hint:
        """Give the hint for a window of the objects `ids` that begins with the frame `first`."""
        rows = {number: n for n, number in enumerate(self.ids)}
        return self.hint.later(first - self.first, [rows.get(number) for number in ids])
