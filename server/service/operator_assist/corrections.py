"""An operator's clicks on a person, as corrections for the tracker of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.messaging.operator_messages import CorrectedPosition, PositionCorrections
from server.service.identity.people import PersonTracker


@dataclass(frozen=True, slots=True)
class PointedPosition:
    """A place in a frame, in pixels of the site's picture.

    Attributes:
        pulse: of the frame.
        x: from the left.
        y: from the top.
        reach: how far off it may be.
    """

    pulse: int
    x: float
    y: float
    reach: float


def corrections_for_tracker(
    people: PersonTracker, camera: str, number: int, places: Sequence[PointedPosition]
) -> PositionCorrections | None:
    """Return an operator's clicks on a person as corrections of the camera's track of that person.

    Frames that are forgotten are left out, and so are those of an earlier run of the camera.

    Returns:
        None: nothing is left, or the camera has not shown this person.
    """
    told, numbers = people.published, [number, *people.registry.aliases(number)]
    known = [it for it in places if told.remembers(it.pulse)]
    tracks = [(it, told.of(camera, numbers, it.pulse)) for it in known]
    boots = [track.boot for _, track in tracks if track is not None]
    if not boots:
        return None
    points = [
        CorrectedPosition(pulse=it.pulse, track=track.track, x=it.x, y=it.y, tolerance=it.reach)
        for it, track in tracks
        if track is not None and track.boot == max(boots)
    ]
    return PositionCorrections(boot=max(boots), corrections=points)
