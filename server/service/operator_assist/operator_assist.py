"""The operator who helps: what cameras foresee becomes flags, and where somebody points goes to a camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import msgspec

from server.config.site_config import Config
from server.service.identity.people import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.operator_assist.corrections import PointedPosition, corrections_for_tracker
from server.service.operator_assist.flags import FlagQueue, RiskEvent


class OperatorAssist:
    """Stands between the cameras' trackers, which know tracks, and the operator, who knows people.

    ``send`` sends a camera what is pointed at in its picture.
    """

    def __init__(self, config: Config, people: PersonTracker, send: Callable[[str, bytes], None]) -> None:
        self.flags = FlagQueue(config.view.flags, config.site.fps)
        self.points = 0
        """Places that were pointed at and went to a camera."""
        self._people, self._send = people, send

    def step(self, epoch: Epoch, config: Config) -> None:
        """Take in what the cameras said of an epoch."""
        people, assist = self._people, config.track.assist
        people.published.frames = assist.memory_frames if assist.enabled else 0
        self.flags.step(epoch.last, self._foreseen(epoch), people.registry.current)

    def point(self, number: int, camera: str, places: Sequence[PointedPosition]) -> tuple[int, list[int]]:
        """Send an operator's clicks on a person to a camera; its tracker corrects present and past tracks.

        Returns:
            How many of the places the camera is told, and the flags that are followed by that; none: they are
            forgotten, or the camera has not shown this person since.
        """
        said = corrections_for_tracker(self._people, camera, number, places)
        if said is None:
            return 0, []
        self._send(camera, msgspec.json.encode(said))
        self.points += len(said.corrections)
        return len(said.corrections), self.flags.pointed(
            number, camera, [it.pulse for it in said.corrections]
        )

    def _foreseen(self, epoch: Epoch) -> Iterator[RiskEvent]:
        """Yield the risk events of an epoch whose persons all have a number."""
        for camera, message in epoch.tracks.items():
            for trouble in message.risk_events:
                whose = [
                    self._people.person_of(camera, message.boot, it, message.last) for it in trouble.tracks
                ]
                known = tuple(dict.fromkeys(number for number in whose if number is not None))
                if known and len(known) == len(whose):
                    yield RiskEvent(
                        camera, known, trouble.reason, trouble.pulse, trouble.margin, trouble.risk
                    )
