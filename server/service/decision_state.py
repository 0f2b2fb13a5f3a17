"""The state of decisions, for the API and the page: each person's current view, and why it was selected."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass

from bestview import Merge, Split
from server.messaging.messages import GopChoices, PersonMerge, PersonSplit, ViewCut
from server.service.identity.occupied_regions import Regions
from server.service.view_selection.decider import GopDecision, ObjectChoice
from server.service.view_selection.explanation import ViewCostExplanation
from server.service.view_selection.queried_reasons import QueriedReasons, SelectedView, SelectionReason

_OCCUPIED_S = 15.0
"""Seconds for which regions are kept: longer than the smoothest delay and all queues."""


@dataclass(frozen=True, slots=True)
class _OccupiedGop:
    first: int
    regions: dict[str, Regions]


class DecisionState:
    """Keeps every object's newest view, and the reasons of the last minute."""

    def __init__(self, fps: float) -> None:
        self.selected_views: dict[int, SelectedView] = {}
        self.merged: dict[int, int] = {}
        self.cuts = 0
        self.end = 0
        """The first pulse that is not decided yet."""
        self._reasons = QueriedReasons(fps)
        self._occupied: deque[_OccupiedGop] = deque()
        self._occupied_frames = _OCCUPIED_S * fps

    def put(self, decision: GopDecision) -> GopChoices:
        """Add a decision; return it as the message that is published."""
        cuts = []
        seen_by: dict[int, list[str]] = {}
        for camera, frames in decision.boxes.items():
            for number, *_ in frames[-1] if frames else ():
                seen_by.setdefault(number, []).append(camera)
        for choice in decision.choices:
            cut = _cut(choice, decision.first)
            if cut is not None:
                cuts.append(cut)
            self._select(decision, choice, tuple(seen_by.get(choice.number, ())))
        numbers = {choice.number for choice in decision.choices}
        self.selected_views = {
            number: view for number, view in self.selected_views.items() if number in numbers
        }
        self.merged = decision.merged
        self._reasons.put(self.selected_views, decision.first, decision.reasons)
        self.cuts += len(cuts)
        self.end = decision.first + decision.frames
        self._put_occupied(decision)
        return GopChoices(
            first=decision.first,
            frames=decision.frames,
            choices={choice.number: choice.camera for choice in decision.choices if choice.camera},
            boxes=decision.boxes,
            cuts=cuts,
            merged=[
                PersonMerge(kept=merge.kept, lost=merge.lost)
                for merge in decision.corrections
                if isinstance(merge, Merge)
            ],
            split=[
                PersonSplit(kept=split.published_id, new_object=split.corrected_id, camera=split.camera)
                for split in decision.corrections
                if isinstance(split, Split)
            ],
        )

    def is_visible(self, number: int) -> bool:
        """Return whether a camera sees an object at the end of the newest decided GOP."""
        view = self.selected_views.get(number)
        return view is not None and bool(view.cameras)

    def resolve(self, number: int) -> int:
        """Return a merged person's current number."""
        return self.merged.get(number, number)

    def occupied(self, camera: str, first: int) -> Regions:
        """Return the regions with people in a camera's GOP that begins with a frame; empty: not known."""
        newest_first = reversed(self._occupied)  # pulses may have restarted
        return next((gop.regions.get(camera, []) for gop in newest_first if gop.first == first), [])

    def _put_occupied(self, decision: GopDecision) -> None:
        if not decision.occupied:
            return
        self._occupied.append(_OccupiedGop(decision.first, dict(decision.occupied)))
        while not 0 <= decision.first - self._occupied[0].first <= self._occupied_frames:
            self._occupied.popleft()

    def forget(self, numbers: Collection[int]) -> None:
        """Forget people."""
        self.selected_views = {
            number: view for number, view in self.selected_views.items() if number not in numbers
        }
        self.merged = {
            old: kept for old, kept in self.merged.items() if old not in numbers and kept not in numbers
        }
        self._reasons.forget(numbers)

    def explain(self, number: int, pulse: int | None = None) -> SelectionReason | None:
        """Explain an object's newest view, or that at a pulse of the last minute.

        Reasons are kept from the first query about an object on.

        Returns:
            None: there is no such object, or no reasons of that time.
        """
        view = self.selected_views.get(self.resolve(number))
        if view is None:
            return None
        newest = self._reasons.query_newest(view)
        return newest if pulse is None else self._reasons.at(view.choice.number, pulse)

    def _select(self, decision: GopDecision, choice: ObjectChoice, cameras: tuple[str, ...]) -> None:
        previous = self.selected_views.get(choice.number)
        self.selected_views[choice.number] = SelectedView(
            choice=choice,
            first=decision.first,
            frames=decision.frames,
            since=decision.first
            if previous is None or previous.choice.camera != choice.camera
            else previous.since,
            cameras=cameras,
        )


def _cut(choice: ObjectChoice, pulse: int) -> ViewCut | None:
    if choice.camera is None or choice.before is None or choice.camera == choice.before:
        return None
    return ViewCut(object=choice.number, pulse=pulse, from_camera=choice.before, to_camera=choice.camera)


def reason(choice: ObjectChoice, explanation: ViewCostExplanation) -> str:
    """Return why this view was selected, as one plain sentence."""
    camera = choice.camera
    if camera is None:
        return "No camera can be shown at the moment."
    if choice.departed or not any(view.seen or view.undetected for view in explanation.views.values()):
        return f"No camera sees this person at the moment; {camera} saw them last."
    return _compare(camera, explanation)


def _compare(camera: str, explanation: ViewCostExplanation) -> str:
    """Return why this camera was selected among those that see the person, or should."""
    view = explanation.views.get(camera)
    if view is not None and not view.seen and view.undetected:
        return f"{camera} does not detect this person, but other cameras locate them in its view."
    possible = {name: view.cost for name, view in explanation.views.items() if view.cost is not None}
    if camera not in possible:  # frames are missing in the look-ahead
        return f"{camera} is shown for as long as it can be: some of its next frames are missing."
    if len(possible) == 1:
        return f"{camera} is the only camera that can be shown."
    if possible[camera] <= min(possible.values()):
        return f"{camera} sees this person best over the next frames."
    if explanation.stay is not None and explanation.cut is not None and explanation.stay > explanation.cut:
        return f"Another camera will see this person better than {camera}: it is too soon to cut."
    return f"Another camera sees this person a little better than {camera}, but not enough to be worth a cut."
