"""The boxes of the newest decided GOPs, for drawing them over the frames."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from server.media.containers.webm import CLUSTER, pulse_of
from server.media.rendering_messages import TIMESCALE, WHOLE_PICTURE, Boxes, Region
from server.messaging.messages import GopChoices
from server.service.identity.occupied_regions import Regions

_TFDT = b"tfdt"


@dataclass(frozen=True, slots=True)
class GopOverlay:
    """The boxes to draw over one GOP of one camera."""

    first: int
    """The pulse of the first entry in ``boxes``."""
    boxes: Boxes
    chosen: int | None = None
    """The person whose box is highlighted."""
    camera: str | None = None
    """The camera that the GOP is from; None: not known."""
    hidden: list[list[Region]] | None = None
    """By frame from ``first`` on the regions to pixelate; in others the whole picture. None: nothing."""


NO_OVERLAY = GopOverlay(0, [])


def hide_people(
    overlay: GopOverlay, regions: Regions, shown: int | None, resolve: Callable[[int], int]
) -> GopOverlay:
    """Return an overlay that hides everybody but one person; None: everybody.

    ``regions`` are those with people in the overlay's GOP. Where they are not known the whole picture is
    hidden. ``resolve`` returns the present number of a merged one.
    """
    person = None if shown is None else resolve(shown)
    hidden: list[list[Region]] = [
        [WHOLE_PICTURE]
        if frame is None
        else [box[1:] for box in frame if person is None or resolve(box[0]) != person]
        for frame in regions
    ]
    return replace(overlay, hidden=hidden)


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
        if choices is None:
            return NO_OVERLAY
        return GopOverlay(choices.first, choices.boxes.get(camera, []), camera=camera)

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
        return GopOverlay(choices.first, boxes, chosen, camera)

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
