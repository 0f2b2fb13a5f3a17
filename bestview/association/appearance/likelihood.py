"""How much likelier two looks in one camera are one person's than two people's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_FEW = 3
"""Distances without which a camera's own are not yet known."""
_OTHERS, _OWN_SHARE, _MOST_SHARE = 0.2, 0.4, 0.6
"""Between different people where nothing is known yet; of that, between the same person's; and at most."""


@dataclass(frozen=True, slots=True)
class LookScale:
    """What distances between looks mean in a camera.

    Attributes:
        own: the usual distance between one person's looks.
        others: how near different people often come: the lower quartile of their distances.
    """

    own: float
    others: float

    @classmethod
    def learned(cls, own: Floats, others: Floats) -> LookScale:
        """Learn from (N,) distances of the same people, and (M,) of different ones."""
        between = float(np.quantile(others, 0.25)) if others.size >= _FEW else _OTHERS
        within = float(np.median(own)) if own.size >= _FEW else _OWN_SHARE * between
        return cls(min(within, _MOST_SHARE * between), between)

    @property
    def middle(self) -> float:
        """Distance that says nothing."""
        return (self.own + self.others) / 2.0

    def slope(self, weights: LookWeights) -> float:
        """Evidence by distance."""
        half = (self.others - self.own) / 2.0
        return weights.look / half if half > 0 else 0.0


@dataclass(frozen=True, slots=True)
class LookWeights:
    """What looks weigh: evidence of looking like oneself, the most of it, and frames for full weight."""

    look: float
    cap: float
    frames: int

    def told(self, distance: Floats, slope: Floats | float, middle: Floats | float) -> Floats:
        """Give the evidence of distances between looks that are known well, any shape."""
        # Not np.clip, which takes longer than all the rest for the few of a group.
        return np.asarray(np.minimum(np.maximum(slope * (middle - distance), -self.cap), self.cap))

    def known(self, count: Floats) -> Floats:
        """Give how much looks of so many frames count, any shape: times the same of the other look."""
        return np.asarray(np.minimum(count / self.frames, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class CameraLooks:
    """The looks of K rows in one camera.

    Attributes:
        rows: (K,) rising.
        total: (K, B) sums of normalised histograms.
        count: (K,) frames in them.
        scale: what distances mean here.
    """

    rows: Ints
    total: Floats
    count: Floats
    scale: LookScale

    def every(self, weights: LookWeights, first: int | None = None) -> Floats:
        """Say what looks say of the `first` rows, of all without it, and all: (K or `first`, K)."""
        root = np.sqrt(self.total / self.count[:, None])
        distance = distance_of(root[:first] @ root.T)
        return look_evidence(distance, self.count[:first, None], self.count, self.scale, weights)


def look_distances(one: Floats, two: Floats) -> Floats:
    """Bhattacharyya distances of mean histograms: (I, B) and (J, B) -> (I, J), 0 alike to 1."""
    return distance_of(np.sqrt(one) @ np.sqrt(two).T)


def distance_of(likeness: Floats) -> Floats:
    """Bhattacharyya distances of what histograms have in common: sums of roots of products, any shape."""
    return np.asarray(np.sqrt(np.minimum(np.maximum(1.0 - likeness, 0.0), 1.0)))


def look_evidence(
    distance: Floats, one: Floats, two: Floats, scale: LookScale, weights: LookWeights
) -> Floats:
    """Evidence of looks: `look` at the usual distance of one person's, as much against at other people's.

    In between it is a straight line, beyond it goes on up to `cap`. Who was seen alone in fewer frames, (N,)
    `one` and `two`, than `frames` weighs less.
    """
    known = weights.known(one) * weights.known(two)
    return weights.told(distance, scale.slope(weights), scale.middle) * known
