"""Decisions for viewers with another delay as events: choices and cuts, with the boxes of balanced ones."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

import msgspec

from server.messaging.messages import GopChoices, ViewCut
from server.service.view_selection.delay_modes import ModeDecision

_KEPT = 256
"""Balanced decisions that are kept for later ones about the same GOPs."""


class ModeChoices:
    """Builds the events of other delays; boxes are there where the balanced decision came first."""

    def __init__(self) -> None:
        self._balanced: OrderedDict[int, GopChoices] = OrderedDict()

    def put(self, choices: GopChoices) -> None:
        """Add a decision of the delay balanced."""
        self._balanced[choices.first] = choices
        while len(self._balanced) > _KEPT:
            self._balanced.popitem(last=False)

    def replace(self, change: Callable[[GopChoices], GopChoices]) -> None:
        """Replace every balanced decision by a changed one about the same frames."""
        self._balanced = OrderedDict((first, change(choices)) for first, choices in self._balanced.items())

    def choices(self, decision: ModeDecision) -> GopChoices:
        """Return a decision as an event; live, nothing is known about its frames yet: it has no boxes."""
        balanced = self._balanced.get(decision.first)
        if balanced is None:
            balanced = GopChoices(
                first=decision.first,
                frames=decision.frames,
                choices={},
                boxes={},
                cuts=[],
                merged=[],
                split=[],
            )
        return msgspec.structs.replace(
            balanced,
            choices={number: camera for number, camera in decision.cameras.items() if camera is not None},
            cuts=[
                ViewCut(object=number, pulse=decision.first, from_camera=before, to_camera=camera)
                for number, before, camera in decision.cuts
            ],
        )
