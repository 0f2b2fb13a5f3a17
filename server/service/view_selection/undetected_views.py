"""Views of people whom a camera does not detect though other cameras locate them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class TestedViews:
    """T tests whether a camera detects a person whom other cameras locate in its view.

    Attributes:
        frame: (T,) counted from the window's first.
        camera: (T,) by index.
        feet: (T, 2) pixels.
        found: (T,) whether the camera detects the person.
    """

    frame: Ints
    camera: Ints
    feet: Floats
    found: Mask


@dataclass(frozen=True, slots=True, eq=False)
class UndetectedViews:
    """V inferred views of people whom a camera does not detect though other cameras locate them.

    Attributes:
        frame: (V,) counted from the window's first.
        camera: (V,) by index.
        person: (V,) by index.
        quality: (V,) as of detected people, times the probability that the camera shows the person.
        tested: the tests to learn from.
    """

    frame: Ints
    camera: Ints
    person: Ints
    quality: Floats
    tested: TestedViews

    @classmethod
    def empty(cls) -> UndetectedViews:
        """Return no views."""
        none = np.zeros(0, dtype=np.int64)
        tested = TestedViews(none, none, np.zeros((0, 2)), np.zeros(0, dtype=np.bool_))
        return cls(none, none, none, np.zeros(0), tested)

    def of(self, people: Ints, count: int, shown: Mask, detected: Ints, factor: float) -> UndetectedViews:
        """Return the views of some of the people, in frames that can be shown.

        Args:
            people: maps each person's index here to the index in the result; -1: left out.
            count: K, the number of people in the result.
            shown: (N, C) whether a camera's frame can be shown.
            detected: flat indices (frame, camera, person) of detected views, which replace inferred ones.
            factor: multiplies the quality.
        """
        if not len(self.frame):
            return self
        person, cell = people[self.person], self.frame * shown.shape[1] + self.camera
        rows = np.flatnonzero((person >= 0) & shown.reshape(-1)[cell] & (factor * self.quality > 0.0))
        is_detected = np.zeros(shown.size * count, dtype=np.bool_)
        is_detected[detected] = True
        rows = rows[~is_detected[cell[rows] * count + person[rows]]]
        quality = factor * self.quality[rows]
        return UndetectedViews(self.frame[rows], self.camera[rows], person[rows], quality, self.tested)
