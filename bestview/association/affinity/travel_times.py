"""How long people take from a camera that loses them to one that finds them, learned from who surely did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview.association.settings import IdentitySettings

Floats = NDArray[np.float64]

_STEP = 2.0
"""From one bin of times to the next: finer ones take longer to fill, and differ by chance."""
_ASIDE = 0.25
"""Share of a way that teaches each of the bins beside its own: nobody takes the same time twice."""
_PRIOR = 1.0
"""Ways that nobody has walked yet count as much as so many: into any camera, and after any time, alike."""
_REMEMBERED = 64
"""Ways out of a camera beyond which all that is known of them is halved: habits change."""


@dataclass(frozen=True, slots=True)
class Sight:
    """Where and when somebody was seen last, or first: the camera's name, and the frame."""

    camera: str
    frame: int


@dataclass(slots=True, eq=False)
class _Exits:
    """The ways out of one camera: their number, and by the next camera (B,) the number of each time."""

    count: float = 0.0
    into: dict[str, Floats] = field(default_factory=dict)


class TravelTimes:
    """Learns the ways from camera to camera, and says what time tells about who has arrived.

    Args:
        settings: `travel_frames` and what belongs to it.
        cameras: how many there are.
    """

    def __init__(self, settings: IdentitySettings, cameras: int) -> None:
        self._settings, self._cameras = settings, max(cameras, 1)
        self.edges = time_bins(settings.travel_frames)
        self._exits: dict[str, _Exits] = {}

    def learn(self, lost: Sight, found: Sight) -> None:
        """Take in a way that somebody surely went; one that took too long teaches nothing."""
        place = self._bin(found.frame - lost.frame)
        if place < 0:
            return
        exits = self._exits.setdefault(lost.camera, _Exits())
        times = exits.into.setdefault(found.camera, np.zeros(self.edges.size - 1))
        for beside, share in ((-1, _ASIDE), (0, 1.0 - 2.0 * _ASIDE), (1, _ASIDE)):
            times[min(max(place + beside, 0), times.size - 1)] += share
        exits.count += 1.0
        if exits.count > _REMEMBERED:
            exits.count /= 2.0
            exits.into = {camera: known / 2.0 for camera, known in exits.into.items()}

    def evidence(self, found: Sequence[Sight], lost: Sequence[Sight]) -> Floats:
        """Say how much likelier people come from where somebody was lost, in that time, than by chance.

        By chance they come into any camera, at any time up to `travel_frames`.

        Args:
            found: N first sightings.
            lost: L last sightings.

        Returns:
            (N, L); 0 where nothing is known, or the way would take no time, or too long.
        """
        said = [self._of(new, old) for new in found for old in lost]
        return np.array(said, dtype=np.float64).reshape(len(found), len(lost))

    def _of(self, found: Sight, lost: Sight) -> float:
        place, exits = self._bin(found.frame - lost.frame), self._exits.get(lost.camera)
        if place < 0 or exits is None:
            return 0.0
        times = exits.into.get(found.camera)
        ways, here = (0.0, 0.0) if times is None else (float(times.sum()), float(times[place]))
        # Both against what chance has: one of all cameras, and the bin's part of all times.
        goes_there = self._cameras * (ways + _PRIOR / self._cameras) / (exits.count + _PRIOR)
        width = float(self.edges[place + 1] - self.edges[place]) / float(self.edges[-1] - self.edges[0])
        in_that_time = (here / width + _PRIOR) / (ways + _PRIOR)
        known = exits.count / (exits.count + self._settings.travel_half_weight_count) if exits.count else 0.0
        cap = self._settings.maximum_travel_evidence
        return float(known * np.clip(np.log(goes_there * in_that_time), -cap, cap))

    def _bin(self, frames: int) -> int:
        """Give the bin of a time; -1: none."""
        if not 1 <= frames < self.edges[-1]:
            return -1
        return int(np.searchsorted(self.edges, frames, side="right")) - 1


def time_bins(longest: int) -> Floats:
    """Give the edges of bins of times from 1 to `longest` frames, each twice as long as the one before."""
    edges = [1.0]
    while edges[-1] * _STEP < longest:
        edges.append(edges[-1] * _STEP)
    return np.array([*edges, longest + 1.0])
