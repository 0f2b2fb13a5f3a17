"""Log-likelihood ratio of one person against two, from the distance between two histograms in one camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MINIMUM_DISTANCES = 3
"""Distances below which a camera's own statistics are not used."""
_DEFAULT_DIFFERENT, _DEFAULT_SAME_SHARE, _MAXIMUM_SAME_SHARE = 0.2, 0.4, 0.6
"""Default distance between different people; default and largest ratio of a person's own distance to it."""


@dataclass(frozen=True, slots=True)
class DistanceScale:
    """Typical distances between histograms in a camera.

    Attributes:
        same_person: the typical distance between histograms of one person.
        different_people_quartile: the lower quartile of the distances between different people.
    """

    same_person: float
    different_people_quartile: float

    @classmethod
    def learned(cls, same_person: Floats, different_people: Floats) -> DistanceScale:
        """Learn from (N,) distances of same people, and (M,) of different ones."""
        different = (
            float(np.quantile(different_people, 0.25))
            if different_people.size >= _MINIMUM_DISTANCES
            else _DEFAULT_DIFFERENT
        )
        same = (
            float(np.median(same_person))
            if same_person.size >= _MINIMUM_DISTANCES
            else _DEFAULT_SAME_SHARE * different
        )
        return cls(min(same, _MAXIMUM_SAME_SHARE * different), different)

    @property
    def neutral_distance(self) -> float:
        """Distance with evidence 0."""
        return (self.same_person + self.different_people_quartile) / 2.0

    def slope(self, weights: AppearanceWeights) -> float:
        """Return the evidence per unit of distance."""
        half = (self.different_people_quartile - self.same_person) / 2.0
        return weights.typical / half if half > 0 else 0.0


@dataclass(frozen=True, slots=True)
class AppearanceWeights:
    """Weights of appearance: evidence at the typical distance, its maximum, and frames for full weight."""

    typical: float
    maximum: float
    full_weight_frames: int

    def evidence(self, distance: Floats, slope: Floats | float, middle: Floats | float) -> Floats:
        """Return the evidence of distances between well-sampled appearances, any shape."""
        # Not np.clip, which is slow on small arrays.
        return np.asarray(np.minimum(np.maximum(slope * (middle - distance), -self.maximum), self.maximum))

    def confidence(self, count: Floats) -> Floats:
        """Return the weight of histograms of so many frames, any shape; both weights are multiplied."""
        return np.asarray(np.minimum(count / self.full_weight_frames, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class CameraAppearances:
    """Mean histograms of K rows in one camera.

    Attributes:
        rows: (K,) rising.
        histogram_sum: (K, B) sums of normalized histograms.
        frame_count: (K,) frames in them.
        scale: typical distances in this camera.
    """

    rows: Ints
    histogram_sum: Floats
    frame_count: Floats
    scale: DistanceScale

    def evidence_matrix(self, weights: AppearanceWeights, first: int | None = None) -> Floats:
        """Compute the evidence between the `first` rows, of all without it, and all: (K or `first`, K)."""
        root = np.sqrt(self.histogram_sum / self.frame_count[:, None])
        distance = bhattacharyya_distance(root[:first] @ root.T)
        return appearance_evidence(
            distance, self.frame_count[:first, None], self.frame_count, self.scale, weights
        )


def bhattacharyya_distances(first: Floats, second: Floats) -> Floats:
    """Compute Bhattacharyya distances of mean histograms: (I, B) and (J, B) -> (I, J), 0 alike to 1."""
    return bhattacharyya_distance(np.sqrt(first) @ np.sqrt(second).T)


def bhattacharyya_distance(coefficient: Floats) -> Floats:
    """Compute Bhattacharyya distances from Bhattacharyya coefficients, any shape."""
    return np.asarray(np.sqrt(np.minimum(np.maximum(1.0 - coefficient, 0.0), 1.0)))


def appearance_evidence(
    distance: Floats,
    first_frames: Floats,
    second_frames: Floats,
    scale: DistanceScale,
    weights: AppearanceWeights,
) -> Floats:
    """Compute appearance evidence: `typical` at one person's typical distance, its negative at two people's.

    It is linear in between and beyond, up to `maximum`. Histograms of fewer frames, (N,) `first_frames` and
    `second_frames`, than `full_weight_frames` weigh less.
    """
    confidence = weights.confidence(first_frames) * weights.confidence(second_frames)
    return weights.evidence(distance, scale.slope(weights), scale.neutral_distance) * confidence
