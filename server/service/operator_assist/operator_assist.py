"""Operator assistance: turns risk events into flags, and sends the operator's positions to the cameras."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import msgspec

from server.config.site_config import Config
from server.messaging.operator_messages import CorrectedPosition, PositionCorrections
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.operator_assist.flags import FlagQueue, PersonRisk


@dataclass(frozen=True, slots=True)
class MarkedPosition:
    """A position in a frame, in pixels of the site's image.

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

    Frames that are no longer kept, and those of an earlier run of the camera, are dropped.

    Returns:
        None: no position is left, or the camera has not shown this person.
    """
    published, numbers = people.published, [number, *people.registry.aliases(number)]
    known = [position for position in positions if published.covers(position.pulse)]
    tracks = [(position, published.latest_track(camera, numbers, position.pulse)) for position in known]
    boots = [track.boot for _, track in tracks if track is not None]
    if not boots:
        return None
    points = [
        CorrectedPosition(
            pulse=position.pulse, track=track.track, x=position.x, y=position.y, tolerance=position.tolerance
        )
        for position, track in tracks
        if track is not None and track.boot == max(boots)
    ]
    return PositionCorrections(boot=max(boots), corrections=points)


class OperatorAssist:
    """Maps the trackers' tracks to people for the operator, and back; ``send`` sends a camera a message."""

    def __init__(self, config: Config, people: PersonTracker, send: Callable[[str, bytes], None]) -> None:
        self.flags = FlagQueue(config.view.flags, config.site.fps)
        self.corrections_sent = 0
        """The number of positions sent to cameras."""
        self._people, self._send = people, send

    def step(self, epoch: Epoch, config: Config) -> None:
        """Process an epoch's risk events."""
        people, assist = self._people, config.track.assist.resolve(config.site.fps)
        people.published.frames = assist.memory_frames if assist.enabled else 0
        self.flags.step(epoch.last, self._risk_events(epoch), people.registry.current)

    def correct(self, number: int, camera: str, positions: Sequence[MarkedPosition]) -> tuple[int, list[int]]:
        """Send an operator's clicks on a person to a camera; its tracker corrects present and past tracks.

        Returns:
            The number of positions sent, and the flags that this responds to; 0: the frames are no longer
            remembered, or the camera has not shown this person since.
        """
        corrections = corrections_for_tracker(self._people, camera, number, positions)
        if corrections is None:
            return 0, []
        self._send(camera, msgspec.msgpack.encode(corrections))
        self.corrections_sent += len(corrections.corrections)
        return len(corrections.corrections), self.flags.record_pointing(
            number, camera, [correction.pulse for correction in corrections.corrections]
        )

    def _risk_events(self, epoch: Epoch) -> Iterator[PersonRisk]:
        """Yield the risk events of an epoch whose persons all have a number."""
        for camera, message in epoch.tracks.items():
            for event in message.risk_events:
                numbers = [
                    self._people.person_of(camera, message.boot, track, message.last)
                    for track in event.tracks
                ]
                known = tuple(dict.fromkeys(number for number in numbers if number is not None))
                if known and len(known) == len(numbers):
                    yield PersonRisk(camera, known, event.reason, event.pulse, event.margin, event.risk)
