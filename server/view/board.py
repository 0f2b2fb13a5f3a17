"""What is known now, for the API and the page: who is there, which camera shows whom, and why."""

from __future__ import annotations

from dataclasses import dataclass

from bestview import Merge, Split
from server.view.decide import GopDecision, ObjectChoice
from server.view.why import Explanation, Why
from server.wire.messages import Cut, GopChoices, Merged, Parted


@dataclass(slots=True)
class Standing:
    """One object's present view."""

    choice: ObjectChoice
    first: int
    """First frame of the newest decided GOP."""
    frames: int
    since: int
    """The frame of the last cut."""
    cameras: tuple[str, ...]
    """Who sees the object at the end of that GOP."""


class Board:
    """Remembers every object's newest decision."""

    def __init__(self) -> None:
        self.standings: dict[int, Standing] = {}
        self.merged: dict[int, int] = {}
        self.cuts = 0
        self._why: Why | None = None

    def put(self, decision: GopDecision) -> GopChoices:
        """Take a decision over; give it as the message that is published and sent to the page."""
        cuts = []
        seen_by: dict[int, list[str]] = {}
        for camera, frames in decision.boxes.items():
            for number, *_ in frames[-1] if frames else ():
                seen_by.setdefault(number, []).append(camera)
        for choice in decision.choices:
            cut = _cut(choice, decision.first)
            if cut is not None:
                cuts.append(cut)
            self._stand(decision, choice, tuple(seen_by.get(choice.number, ())))
        numbers = {choice.number for choice in decision.choices}
        self.standings = {number: it for number, it in self.standings.items() if number in numbers}
        self.merged, self._why = decision.merged, decision.why
        self.cuts += len(cuts)
        return GopChoices(
            first=decision.first,
            frames=decision.frames,
            choices={choice.number: choice.camera for choice in decision.choices if choice.camera},
            boxes=decision.boxes,
            cuts=cuts,
            merged=[
                Merged(kept=it.kept, lost=it.lost) for it in decision.corrections if isinstance(it, Merge)
            ],
            split=[
                Parted(kept=it.kept, parted=it.parted, camera=it.camera)
                for it in decision.corrections
                if isinstance(it, Split)
            ],
        )

    def resolve(self, number: int) -> int:
        """Give the number that a merged one goes by now."""
        return self.merged.get(number, number)

    def explain(self, number: int) -> Explanation:
        """Give the numbers behind an object's newest choice.

        Raises:
            KeyError: there is none.
        """
        if self._why is None:
            raise KeyError(number)
        return self._why.of(number)

    def _stand(self, decision: GopDecision, choice: ObjectChoice, cameras: tuple[str, ...]) -> None:
        known = self.standings.get(choice.number)
        stays = known is not None and known.choice.camera == choice.camera
        self.standings[choice.number] = Standing(
            choice=choice,
            first=decision.first,
            frames=decision.frames,
            since=known.since if known is not None and stays else decision.first,
            cameras=cameras,
        )


def _cut(choice: ObjectChoice, pulse: int) -> Cut | None:
    if choice.camera is None or choice.before is None or choice.camera == choice.before:
        return None
    return Cut(object=choice.number, pulse=pulse, from_camera=choice.before, to_camera=choice.camera)


def reason(choice: ObjectChoice, why: Explanation) -> str:
    """Say in one plain sentence why this view was chosen."""
    camera = choice.camera
    if camera is None:
        return "No camera's picture can be shown at the moment."
    if choice.away or not any(view.seen for view in why.views.values()):
        return f"Nobody sees this person at the moment; {camera} saw them last."
    possible = {name: view.cost for name, view in why.views.items() if view.cost is not None}
    if len(possible) == 1:
        return f"{camera} is the only camera whose picture can be shown."
    if camera in possible and possible[camera] <= min(possible.values()):
        return f"{camera} sees this person best over the next frames."
    if why.stay is not None and why.cut is not None and why.stay > why.cut:
        return f"Another camera sees this person better, but {camera} has not been shown for long enough."
    return f"Another camera sees this person a little better than {camera}, but not enough to be worth a cut."
