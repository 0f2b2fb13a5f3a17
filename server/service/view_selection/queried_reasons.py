"""The reasons of the last minute's views, for people who were recently queried."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from server.service.view_selection.decider import ObjectChoice
from server.service.view_selection.explanation import GopExplanation, ViewCostExplanation

_QUERY_EXPIRY_S = 30.0
"""Reasons are no longer kept for a person not queried for so long."""
_KEPT_S = 65.0
"""A minute, and the delay to the screen."""


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
    """The cameras that see the object at the end of the GOP."""


@dataclass(frozen=True, slots=True)
class SelectionReason:
    """One object's view in one GOP, and the costs it was selected by."""

    view: SelectedView
    explanation: ViewCostExplanation


class QueriedReasons:
    """Keeps the reasons of recent GOPs, for objects that were recently queried, from their first query on."""

    def __init__(self, fps: float) -> None:
        self._query_expiry, self._keep_frames = _QUERY_EXPIRY_S * fps, _KEPT_S * fps
        self._queried: dict[int, int] = {}
        """By object: the newest GOP at its last query."""
        self._reasons: dict[int, list[SelectionReason]] = {}
        """By object, in order."""
        self._newest = 0
        self._newest_reasons: GopExplanation | None = None

    def put(self, selected_views: Mapping[int, SelectedView], first: int, reasons: GopExplanation) -> None:
        """Add the GOP that begins at `first`."""
        if first < self._newest:  # the pulses have restarted
            self._queried, self._reasons = {}, {}
        self._newest, self._newest_reasons = first, reasons
        self._queried = {
            number: pulse for number, pulse in self._queried.items() if pulse >= first - self._query_expiry
        }
        self._reasons = {number: kept for number, kept in self._reasons.items() if number in self._queried}
        for number in self._queried:
            if number in selected_views:
                self._keep(selected_views[number], reasons)

    def query_newest(self, view: SelectedView) -> SelectionReason:
        """Explain an object's newest view; from now on its reasons are kept.

        Raises:
            KeyError: nothing is decided about it.
        """
        number = view.choice.number
        self._queried[number] = self._newest
        reasons = self._reasons.get(number, [])
        if reasons and reasons[-1].view.first == view.first:
            return reasons[-1]
        if self._newest_reasons is None:
            raise KeyError(number)
        return self._keep(view, self._newest_reasons)

    def forget(self, numbers: Collection[int]) -> None:
        """Forget objects. The costs of the newest GOP stay until the next one is decided."""
        for number in numbers:
            self._queried.pop(number, None)
            self._reasons.pop(number, None)

    def at(self, number: int, pulse: int) -> SelectionReason | None:
        """Explain the view of an object at a pulse; None: its reasons are not kept."""
        reasons = self._reasons.get(number, [])
        place = bisect_right(reasons, pulse, key=lambda reason: reason.view.first) - 1
        if place < 0:
            return None
        view = reasons[place].view
        return reasons[place] if pulse < view.first + view.frames else None

    def _keep(self, view: SelectedView, reasons: GopExplanation) -> SelectionReason:
        reason = SelectionReason(view, reasons.of(view.choice.number))
        oldest = view.first - self._keep_frames
        recent = [
            reason for reason in self._reasons.get(view.choice.number, []) if reason.view.first >= oldest
        ]
        self._reasons[view.choice.number] = [*recent, reason]
        return reason
