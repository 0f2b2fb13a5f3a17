"""Decisions for viewers with another delay as events: choices and cuts, with the boxes of the usual ones."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

import msgspec

from server.messaging.messages import GopChoices, ViewCut
from server.service.view_selection.delay_modes import ModeDecision

_KEPT = 256
"""Usual decisions that are kept for later ones about the same GOPs."""


class ModeChoices:
    """Builds the events of other delays; boxes are there where the usual decision came first."""

    def __init__(self) -> None:
        self._usual: OrderedDict[int, GopChoices] = OrderedDict()

    def put(self, choices: GopChoices) -> None:
        """Add a usual decision."""
        self._usual[choices.first] = choices
        while len(self._usual) > _KEPT:
            self._usual.popitem(last=False)

    def replace(self, change: Callable[[GopChoices], GopChoices]) -> None:
        """Replace every usual decision by a changed one about the same frames."""
        self._usual = OrderedDict((first, change(choices)) for first, choices in self._usual.items())

    def choices(self, decision: ModeDecision) -> GopChoices:
        """Return a decision as an event; live, nothing is known about its frames yet: it has no boxes."""
        usual = self._usual.get(decision.first)
        if usual is None:
            usual = GopChoices(
                first=decision.first,
                frames=decision.frames,
                choices={},
                boxes={},
                cuts=[],
                merged=[],
                split=[],
            )
        return msgspec.structs.replace(
            usual,
            choices={number: camera for number, camera in decision.cameras.items() if camera is not None},
            cuts=[
                ViewCut(object=number, pulse=decision.first, from_camera=before, to_camera=camera)
                for number, before, camera in decision.cuts
            ],
        )
