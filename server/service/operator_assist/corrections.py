"""Turns an operator's clicks on a person into corrections for a camera's tracker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.messaging.operator_messages import CorrectedPosition, PositionCorrections
from server.service.identity.people import PersonTracker


@dataclass(frozen=True, slots=True)
class MarkedPosition:
    """A position in a frame, in pixels of the site's picture.

    Attributes:
        pulse: the frame.
        x: from the left.
        y: from the top.
        tolerance: how far off it may be.
    """

    pulse: int
    x: float
    y: float
    tolerance: float


def corrections_for_tracker(
    people: PersonTracker, camera: str, number: int, positions: Sequence[MarkedPosition]
) -> PositionCorrections | None:
    """Return an operator's clicks on a person as corrections of the camera's track of that person.

    Frames no longer remembered are left out, and those of an earlier run of the camera.

    Returns:
        None: no position is left, or the camera has not shown this person.
    """
    published, numbers = people.published, [number, *people.registry.aliases(number)]
    known = [it for it in positions if published.remembers(it.pulse)]
    tracks = [(it, published.of(camera, numbers, it.pulse)) for it in known]
    boots = [track.boot for _, track in tracks if track is not None]
    if not boots:
        return None
    points = [
        CorrectedPosition(pulse=it.pulse, track=track.track, x=it.x, y=it.y, tolerance=it.tolerance)
        for it, track in tracks
        if track is not None and track.boot == max(boots)
    ]
    return PositionCorrections(boot=max(boots), corrections=points)
