"""The boxes of the newest decided GOPs, for drawing them over the frames."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from server.media.containers.webm import CLUSTER, pulse_of
from server.media.rendering_messages import TIMESCALE, Boxes
from server.messaging.messages import GopChoices

_TFDT = b"tfdt"


@dataclass(frozen=True, slots=True)
class GopOverlay:
    """The boxes to draw over one GOP of one camera."""

    first: int
    """The pulse of the first entry in ``boxes``."""
    boxes: Boxes
    chosen: int | None = None
    """The person whose box is highlighted."""


NO_OVERLAY = GopOverlay(0, [])


def first_pulse(fragments: bytes, fps: float) -> int:
    """Return the first pulse of MP4 fragments, or of WebM clusters."""
    if fragments.startswith(CLUSTER):
        return pulse_of(fragments, fps)
    at = fragments.index(_TFDT) + len(_TFDT) + 4  # behind version and flags
    (ticks,) = struct.unpack_from(">Q", fragments, at)
    return round(int(ticks) * fps / TIMESCALE)


class DecidedBoxes:
    """Keeps the newest ``gops`` decisions; ``resolve`` returns the present number of a merged one."""

    def __init__(self, resolve: Callable[[int], int], fps: float, gops: int) -> None:
        self._resolve, self._fps = resolve, fps
        self._decisions: deque[GopChoices] = deque(maxlen=gops)

    def put(self, choices: GopChoices) -> None:
        """Add a decision."""
        self._decisions.append(choices)

    @property
    def newest(self) -> int | None:
        """The last decided frame; None before the first decision."""
        return self._decisions[-1].first + self._decisions[-1].frames - 1 if self._decisions else None

    def overlay_of_camera(self, camera: str, fragments: bytes) -> GopOverlay:
        """Return all boxes in a camera's GOP."""
        choices = self._decision_of(fragments)
        return NO_OVERLAY if choices is None else GopOverlay(choices.first, choices.boxes.get(camera, []))

    def overlay_of_person(
        self, number: int, fragments: bytes, *, scoped_to_person: bool = False
    ) -> GopOverlay:
        """Return all boxes in a GOP of a person's stream, and the number that the person had in it.

        ``scoped_to_person``: only the person's own boxes, by any of their numbers.
        """
        choices = self._decision_of(fragments)
        if choices is None:
            return NO_OVERLAY
        chosen = number if number in choices.choices else self._resolve(number)
        camera = choices.choices.get(chosen)
        if camera is None:
            return NO_OVERLAY
        boxes = choices.boxes.get(camera, [])
        if scoped_to_person:
            person = self._resolve(number)
            boxes = [[box for box in frame if self._resolve(box[0]) == person] for frame in boxes]
        return GopOverlay(choices.first, boxes, chosen)

    def _decision_of(self, fragments: bytes) -> GopChoices | None:
        pulse = first_pulse(fragments, self._fps)
        return next(
            (
                decision
                for decision in self._decisions
                if decision.first <= pulse < decision.first + decision.frames
            ),
            None,
        )
