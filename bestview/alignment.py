"""Homographies are never exact: what cameras say of the same people brings their grounds together.

Not in the paper. Feet of one person that two cameras put a little apart, here more and there less, make
every join uncertain. Once people are joined, the disagreement is known, and most of it is the same for
everybody: a shift, and a stretch or turn across the floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bestview.sightings import Sightings

_ARM = 5.0
"""Person heights from the middle at which a sighting says as much about stretch and turn as about a shift."""
_MEMORY = 0.9995
"""Share of what is known that lives on from one update to the next: half of it for about 1400 updates."""
_FAR = 2.0
"""Gates apart from which two sightings that were joined are not believed to be one person's."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Correction:
    """What is added to a place `p` on a camera's ground: ``shift + (p - middle) linear``."""

    middle: Floats
    shift: Floats
    linear: Floats

    def of(self, places: Floats) -> Floats:
        """Give the correction of (..., 2) places."""
        return self.shift + _times(places - self.middle, self.linear)


@dataclass(slots=True)
class _Camera:
    """Sums over sightings `p` on a camera's ground and their distances `d` to where others see the person."""

    count: float = 0.0
    place: Floats = field(default_factory=lambda: np.zeros(2))
    off: Floats = field(default_factory=lambda: np.zeros(2))
    place_place: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    place_off: Floats = field(default_factory=lambda: np.zeros((2, 2)))

    def fade(self) -> None:
        self.count *= _MEMORY
        self.place *= _MEMORY
        self.off *= _MEMORY
        self.place_place *= _MEMORY
        self.place_off *= _MEMORY

    def add(self, places: Floats, offs: Floats) -> None:
        """Take in (P, 2) places and as many distances."""
        self.count += len(places)
        self.place += places.sum(axis=0)
        self.off += offs.sum(axis=0)
        self.place_place += (places[:, :, None] * places[:, None, :]).sum(axis=0)
        self.place_off += (places[:, :, None] * offs[:, None, :]).sum(axis=0)

    def correction(self, trust: float, arm: float) -> _Correction:
        """Find the correction by ridge regression."""
        middle = self.place / self.count
        spread = self.place_place - self.count * middle[:, None] * middle + trust * arm**2 * np.eye(2)
        (xx, xy), (_, yy) = spread.tolist()
        # The inverse and all products written out: a BLAS may round otherwise on another machine.
        inverse = np.array([[yy, -xy], [-xy, xx]]) / (xx * yy - xy * xy)
        linear = _times(inverse, self.place_off - middle[:, None] * self.off)
        return _Correction(middle, self.off / (self.count + trust), linear)


class GroundAlignment:
    """Learns, per calibrated camera, an affine correction of its ground towards where the others see people.

    Each correction `d(p) = b + (p - m) L` minimises `sum |d(p) - off|^2` over the sightings of people who
    are joined, plus `trust (|b|^2 + arm^2 |L|^2)`: at first the homographies are believed, and where nobody
    was seen in two cameras they stay believed.

    Args:
        trust: sightings that weigh as much as the homographies; infinite: nothing is corrected.
    """

    def __init__(self, trust: float) -> None:
        self._trust = trust
        self._cameras: dict[str, _Camera] = {}
        self._corrections: dict[str, _Correction] = {}

    def corrected(self, seen: Sightings) -> Sightings:
        """Give the sightings with their places on the common ground corrected."""
        if not self._corrections:
            return seen
        ground = seen.ground.copy()
        for rows in seen.cameras():
            correction = self._corrections.get(seen.keys[rows.start].camera)
            if correction is not None:
                ground[rows] += correction.of(ground[rows])
        return replace(seen, ground=ground)

    def learn(
        self,
        given: Sightings,
        seen: Sightings,
        person: NDArray[np.int64],
        present: NDArray[np.bool_],
        gate: float,
        height: float,
    ) -> None:
        """Take in who is seen by several cameras at once.

        Args:
            given: the sightings as the homographies give them.
            seen: the same as `corrected` gives them.
            person: (T,) whose tracks they are.
            present: (T,) seen just now.
            gate: distance within which feet are the same, ground units.
            height: of a person, ground units.
        """
        if not (np.isfinite(self._trust) and gate > 0 and height > 0):
            return
        believed = seen.ground
        there = present[:, None] & ~np.isnan(believed[..., 0])
        _, row = np.unique(person, return_inverse=True)
        total = np.zeros((row.max(initial=-1) + 1, *believed.shape[1:]))
        count = np.zeros(total.shape[:2])
        np.add.at(total, row, np.where(there[..., None], believed, 0.0))
        np.add.at(count, row, there)
        # Where somebody is seen by others than this one; one camera has one track of a person at a time.
        common = there & (count[row] > 1)
        elsewhere = (
            np.where(common[..., None], total[row] - believed, 0.0) / np.maximum(count[row] - 1, 1)[..., None]
        )
        frames = common.sum(axis=1)
        seen_twice = frames > 0
        target = elsewhere.sum(axis=1) / np.maximum(frames, 1)[:, None]
        own, place = (
            np.where(common[..., None], ground, 0.0).sum(axis=1) / np.maximum(frames, 1)[:, None]
            for ground in (believed, given.ground)
        )
        near = seen_twice & (np.hypot(*(target - own).T) <= _FAR * gate)
        self._take_in(seen, near, place, target - place)
        arm = _ARM * height
        self._corrections = {
            name: camera.correction(self._trust, arm) for name, camera in sorted(self._cameras.items())
        }

    def _take_in(self, seen: Sightings, rows: NDArray[np.bool_], places: Floats, offs: Floats) -> None:
        """Add the sightings of `rows` to their cameras' sums; what was known before fades."""
        for camera in self._cameras.values():
            camera.fade()
        for tracks in seen.cameras():
            mine = np.flatnonzero(rows[tracks]) + tracks.start
            if mine.size:
                camera = self._cameras.setdefault(seen.keys[tracks.start].camera, _Camera())
                camera.add(places[mine], offs[mine])


def _times(rows: Floats, matrix: Floats) -> Floats:
    """(..., 2) rows times (2, 2)."""
    return np.asarray(rows[..., :1] * matrix[0] + rows[..., 1:] * matrix[1])
