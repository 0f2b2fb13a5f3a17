"""The people remembered, and finding again who left."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bestview.appearance import Appearances
from bestview.evidence import TrackKey
from bestview.identity_settings import IdentitySettings
from bestview.succession import Place, clearly_least, picture_cost

_APPEARANCE_RATIO = 1.5
"""How many times further the second likeliest must be before appearance alone decides."""

_LOOSE = 2.0
"""How many appearance gates apart two sightings may be that place already joins."""

_NEVER = 1e6


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


@dataclass(frozen=True, slots=True)
class Finding:
    """What finding people again goes by.

    Attributes:
        settings: of identity.
        appearances: to compare looks with.
        gate: distance within which feet are the same, ground units (NaN: no ground yet).
        height: of a person in ground units (NaN likewise).
    """

    settings: IdentitySettings
    appearances: Appearances
    gate: float
    height: float

    def match(self, found: list[Person], lost: list[Person]) -> list[int]:
        """For each newly `found` person the index of the `lost` one they are, or -1.

        Place decides for those lost a moment ago; appearance for the others, and only where nobody
        else looks nearly as like: a wrong number is worse than a new one. One assignment.
        """
        if not found or not lost:
            return [-1] * len(found)
        cost = np.array([[self._place_cost(new, old) for old in lost] for new in found])
        looks = np.array([[self._unlike(new, old) for old in lost] for new in found])
        gate = self.appearances.gate(self.settings.appearance_gate, self.settings.appearance_share)
        by_place = (cost <= 1.0) & ~(looks > _LOOSE * gate)
        by_look = (
            ~np.isfinite(cost) & (cost != np.inf) & (looks <= gate) & clearly_least(looks, _APPEARANCE_RATIO)
        )
        cost = np.where(by_place, cost, np.where(by_look, 1.0 + looks, _NEVER))
        row, column = linear_sum_assignment(cost)
        answer = [-1] * len(found)
        for i, j in zip(row, column, strict=True):
            if cost[i, j] < _NEVER:
                answer[int(i)] = int(j)
        return answer

    def _place_cost(self, new: Person, old: Person) -> float:
        """Distance between loss and finding in units of what is plausible; NaN: place says nothing."""
        gap = new.first_frame - old.last_frame
        if gap <= 0 and any(new.first[c].frame <= old.last[c].frame for c in new.first if c in old.last):
            return float("inf")  # seen at the same time: two people
        if gap > self.settings.continuity:
            return float("nan")
        gap = max(gap, 0)
        costs = [self._ground_cost(a, b, gap) for a in new.first.values() for b in old.last.values()]
        costs += [picture_cost(new.first[c], old.last[c]) for c in sorted(new.first) if c in old.last]
        known = [cost for cost in costs if not np.isnan(cost)]
        if not known:
            return float("nan")
        best = min(known)
        return best if best <= 1.0 else float("inf")  # nobody is that fast

    def _ground_cost(self, new: Place, old: Place, gap: int) -> float:
        apart = float(np.hypot(*(new.ground - old.ground)))
        return apart / (self.gate + self.settings.speed_heights * self.height * gap)

    def _unlike(self, new: Person, old: Person) -> float:
        """Appearance distance, in a common camera where there is one; NaN: unknown."""
        common = [(c, c) for c in sorted(new.looks) if c in old.looks]
        pairs = common or [(a, b) for a in sorted(new.looks) for b in sorted(old.looks)]
        apart = [
            float(np.abs(self._curve(new, a) - self._curve(old, b)).mean())
            for a, b in pairs
            if new.looks[a].total.size == old.looks[b].total.size
        ]
        return float(np.mean(apart)) if apart else float("nan")

    def _curve(self, person: Person, camera: str) -> NDArray[np.float64]:
        look = person.looks[camera]
        return self.appearances.equalised(camera, look.total / look.count)
