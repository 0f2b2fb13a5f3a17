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


@dataclass(frozen=True, slots=True)
class LookWeights:
    """What looks weigh: evidence of looking like oneself, the most of it, and frames for full weight."""

    look: float
    cap: float
    frames: int


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


def look_distances(one: Floats, two: Floats) -> Floats:
    """Bhattacharyya distances of mean histograms: (I, B) and (J, B) -> (I, J), 0 alike to 1."""
    return distance_of(np.sqrt(one) @ np.sqrt(two).T)


def distance_of(likeness: Floats) -> Floats:
    """Bhattacharyya distances of what histograms have in common: sums of roots of products, any shape."""
    return np.asarray(np.sqrt(np.clip(1.0 - likeness, 0.0, 1.0)))


def look_evidence(
    distance: Floats, one: Floats, two: Floats, scale: LookScale, weights: LookWeights
) -> Floats:
    """Evidence of looks: `look` at the usual distance of one person's, as much against at other people's.

    In between it is a straight line, beyond it goes on up to `cap`. Who was seen alone in fewer frames, (N,)
    `one` and `two`, than `frames` weighs less.
    """
    middle, half = (scale.own + scale.others) / 2.0, (scale.others - scale.own) / 2.0
    slope = weights.look / half if half > 0 else 0.0
    known = np.minimum(one / weights.frames, 1.0) * np.minimum(two / weights.frames, 1.0)
    return np.asarray(np.clip(slope * (middle - distance), -weights.cap, weights.cap) * known)
