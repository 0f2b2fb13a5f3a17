"""Views of people whom a camera does not find, though others know where they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class TestedViews:
    """T tests of cameras at places where a person stands, as other cameras know.

    Attributes:
        frame: (T,) of the outlook.
        camera: (T,) by index.
        feet: (T, 2) pixels.
        found: (T,) whether the camera found them.
    """

    frame: Ints
    camera: Ints
    feet: Floats
    found: Mask


@dataclass(frozen=True, slots=True, eq=False)
class UndetectedViews:
    """V views of people whom a camera does not detect, though other cameras know where they stand.

    Attributes:
        frame: (V,) of the outlook.
        camera: (V,) by index.
        person: (V,) by index.
        quality: (V,) as of those who are found, times how surely they show.
        tested: what is to be learned from it.
    """

    frame: Ints
    camera: Ints
    person: Ints
    quality: Floats
    tested: TestedViews

    @classmethod
    def nobody(cls) -> UndetectedViews:
        """Return no views."""
        none = np.zeros(0, dtype=np.int64)
        tested = TestedViews(none, none, np.zeros((0, 2)), np.zeros(0, dtype=np.bool_))
        return cls(none, none, none, np.zeros(0), tested)

    def of(self, people: Ints, count: int, shown: Mask, found: Ints, factor: float) -> UndetectedViews:
        """Return the views of some of the people, in frames that can be shown.

        Args:
            people: by index of everybody here, their index among those asked for; -1: they are not.
            count: K, how many are asked for.
            shown: (N, C) what can be shown.
            found: cells, frame by frame, camera by camera and person by person, of views that are found after
                all: between two looks somebody may be.
            factor: that the quality is taken times.
        """
        if not len(self.frame):
            return self
        person, cell = people[self.person], self.frame * shown.shape[1] + self.camera
        rows = np.flatnonzero((person >= 0) & shown.reshape(-1)[cell] & (factor * self.quality > 0.0))
        taken = np.zeros(shown.size * count, dtype=np.bool_)
        taken[found] = True
        rows = rows[~taken[cell[rows] * count + person[rows]]]
        quality = factor * self.quality[rows]
        return UndetectedViews(self.frame[rows], self.camera[rows], person[rows], quality, self.tested)
