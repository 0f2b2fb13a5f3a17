"""The people remembered."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview.evidence import TrackKey
from bestview.succession import Place


@dataclass(slots=True)
class Look:
    """Mean histogram of a person in one camera."""

    total: NDArray[np.float64]
    count: int


@dataclass(slots=True, eq=False)
class Person:
    """Somebody, numbered (``number > 0``) or not yet.

    Attributes:
        number: 0 until confirmed.
        gone: said to be gone, and not back yet.
        updates: in which they were seen.
        first: by camera, where they were first seen.
        last: by camera, where they were last seen.
        looks: by camera.
        tracks: by track, the updates in which it was seen as this person.
    """

    number: int = 0
    gone: bool = False
    updates: int = 0
    first: dict[str, Place] = field(default_factory=dict)
    last: dict[str, Place] = field(default_factory=dict)
    looks: dict[str, Look] = field(default_factory=dict)
    tracks: dict[TrackKey, int] = field(default_factory=dict)

    @property
    def first_frame(self) -> int:
        """Frame of the first sighting in any camera."""
        return min((place.frame for place in self.first.values()), default=0)

    @property
    def last_frame(self) -> int:
        """Frame of the last sighting in any camera."""
        return max((place.frame for place in self.last.values()), default=-1)

    def see(self, key: TrackKey, first: Place, last: Place) -> None:
        """Take in one more sighting, by its first and last frame."""
        self.first.setdefault(key.camera, first)
        self.last[key.camera] = last
        self.tracks[key] = self.tracks.get(key, 0) + 1

    def look(self, camera: str, histogram: NDArray[np.float64]) -> None:
        """Take in one more normalised (B,) histogram."""
        look = self.looks.get(camera)
        if look is None:
            self.looks[camera] = Look(histogram.copy(), 1)
        else:
            look.total, look.count = look.total + histogram, look.count + 1

    def absorb(self, other: Person) -> None:
        """Take over what `other` was seen as: the two are one."""
        for camera, place in sorted(other.first.items()):
            if camera not in self.first or place.frame < self.first[camera].frame:
                self.first[camera] = place
        for camera, place in sorted(other.last.items()):
            if camera not in self.last or place.frame >= self.last[camera].frame:
                self.last[camera] = place
        for camera, look in sorted(other.looks.items()):
            mine = self.looks.setdefault(camera, Look(np.zeros_like(look.total), 0))
            mine.total, mine.count = mine.total + look.total, mine.count + look.count
        for key, updates in sorted(other.tracks.items()):
            self.tracks[key] = self.tracks.get(key, 0) + updates
        self.updates = max(self.updates, other.updates)
