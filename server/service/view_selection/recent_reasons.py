"""Why each view of the last minute was chosen, of those whom somebody asks about."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass

from server.service.view_selection.decider import ObjectChoice
from server.service.view_selection.explanation import Explanation, SelectionReasons

_ASKED_S = 30.0
"""Who was not asked about for so long is not followed any more."""
_KEPT_S = 65.0
"""A minute, and what is on its way to the screen."""


@dataclass(frozen=True, slots=True)
class SelectedView:
    """One object's view in one GOP."""

    choice: ObjectChoice
    first: int
    """First frame of the GOP."""
    frames: int
    since: int
    """The frame of the last cut."""
    cameras: tuple[str, ...]
    """Who sees the object at the end of the GOP."""


@dataclass(frozen=True, slots=True)
class SelectionReason:
    """One object's view in one GOP, and the costs it was selected by."""

    standing: SelectedView
    why: Explanation


class RecentReasons:
    """Keeps the reasons of recent GOPs, from the first query about an object on."""

    def __init__(self, fps: float) -> None:
        self._asked_for, self._kept_for = _ASKED_S * fps, _KEPT_S * fps
        self._asked: dict[int, int] = {}
        """By object: the GOP after which it was asked about last."""
        self._kept: dict[int, list[SelectionReason]] = {}
        """By object, in order."""
        self._newest = 0
        self._why: SelectionReasons | None = None

    def put(self, selected_views: Mapping[int, SelectedView], first: int, why: SelectionReasons) -> None:
        """Take in the GOP that begins at `first`."""
        if first < self._newest:  # the pulses began anew
            self._asked, self._kept = {}, {}
        self._newest, self._why = first, why
        self._asked = {it: at for it, at in self._asked.items() if at >= first - self._asked_for}
        self._kept = {it: kept for it, kept in self._kept.items() if it in self._asked}
        for number in self._asked:
            if number in selected_views:
                self._keep(selected_views[number], why)

    def newest(self, standing: SelectedView) -> SelectionReason:
        """Explain an object's newest view; from now on its reasons are kept.

        Raises:
            KeyError: nothing was decided about it.
        """
        number = standing.choice.number
        self._asked[number] = self._newest
        kept = self._kept.get(number, [])
        if kept and kept[-1].standing.first == standing.first:
            return kept[-1]
        if self._why is None:
            raise KeyError(number)
        return self._keep(standing, self._why)

    def at(self, number: int, pulse: int) -> SelectionReason | None:
        """Explain the view of an object at a pulse; None: that is not kept."""
        kept = self._kept.get(number, [])
        place = bisect_right(kept, pulse, key=lambda it: it.standing.first) - 1
        if place < 0:
            return None
        standing = kept[place].standing
        return kept[place] if pulse < standing.first + standing.frames else None

    def _keep(self, standing: SelectedView, why: SelectionReasons) -> SelectionReason:
        reason = SelectionReason(standing, why.of(standing.choice.number))
        oldest = standing.first - self._kept_for
        kept = [it for it in self._kept.get(standing.choice.number, []) if it.standing.first >= oldest]
        self._kept[standing.choice.number] = [*kept, reason]
        return reason
