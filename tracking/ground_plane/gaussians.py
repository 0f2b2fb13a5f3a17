"""Gaussians on the ground plane, for arrays of covariances (2, 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

LOG_2PI = float(np.log(2.0 * np.pi))


def determinants(matrices: Floats) -> Floats:
    """Return the determinants of matrices (..., 2, 2)."""
    return np.asarray(matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0])


def inverses(matrices: Floats) -> Floats:
    """Return the inverses of matrices (..., 2, 2)."""
    adjugate = np.empty_like(matrices)
    adjugate[..., 0, 0], adjugate[..., 1, 1] = matrices[..., 1, 1], matrices[..., 0, 0]
    adjugate[..., 0, 1], adjugate[..., 1, 0] = -matrices[..., 0, 1], -matrices[..., 1, 0]
    return np.asarray(adjugate / determinants(matrices)[..., None, None])


def squared_distances(offsets: Floats, covariances: Floats) -> Floats:
    """Return the squared Mahalanobis distances of offsets (..., 2) under covariances (..., 2, 2)."""
    x, y = offsets[..., 0], offsets[..., 1]
    twice_covariance = covariances[..., 0, 1] + covariances[..., 1, 0]
    adjugate = covariances[..., 1, 1] * x * x - twice_covariance * x * y + covariances[..., 0, 0] * y * y
    return np.asarray(adjugate / determinants(covariances))


def negative_log_densities(offsets: Floats, covariances: Floats) -> Floats:
    """Return -log N(offset; 0, covariance), where the density is per unit of area."""
    return OffsetDensities.of(offsets, covariances).costs


@dataclass(frozen=True, slots=True, eq=False)
class OffsetDensities:
    """The densities of offsets under their covariances.

    Attributes:
        distances: (...) squared Mahalanobis distances.
        costs: (...) negative logs of the densities, per unit of area.
    """

    distances: Floats
    costs: Floats

    def correlated(self, weight: float) -> Floats:
        """Return the costs of offsets that err alike from frame to frame, so that each counts for `weight`.

        Only the density does: people are told apart by all of the distance.
        """
        distance = 0.5 * self.distances
        return np.asarray(distance + weight * (self.costs - distance))

    def at(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> OffsetDensities:
        """Return those (E,) of some pairs, of all pairs (K, L)."""
        return OffsetDensities(self.distances[row, column], self.costs[row, column])

    @classmethod
    def of(cls, offsets: Floats, covariances: Floats) -> OffsetDensities:
        """Compute them for offsets (..., 2) and covariances (..., 2, 2)."""
        distances = squared_distances(offsets, covariances)
        return cls(distances, 0.5 * (distances + np.log(determinants(covariances))) + LOG_2PI)


def fuse(places: Floats, covariances: Floats) -> tuple[Floats, Floats]:
    """Return the place (2,) and covariance (2, 2) that independent measurements (N, 2) of it determine."""
    weights = inverses(covariances)
    covariance = inverses(weights.sum(axis=0))
    return np.asarray(covariance @ np.einsum("nij,nj->i", weights, places)), covariance


def fuse_two(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Return what `fuse` does for two measurements, each a place and its covariance, in less time."""
    information = [0.0] * 5  # xx, xy, yy of the inverse covariance, and its product with the place
    for place, covariance in (first, second):
        (xx, xy), (_, yy) = covariance.tolist()
        x, y = place.tolist()
        scale = 1.0 / (xx * yy - xy * xy)
        xx, xy, yy = scale * yy, -scale * xy, scale * xx
        found = (xx, xy, yy, xx * x + xy * y, xy * x + yy * y)
        information = [one + other for one, other in zip(information, found, strict=True)]
    xx, xy, yy, x, y = information
    scale = 1.0 / (xx * yy - xy * xy)
    xx, xy, yy = scale * yy, -scale * xy, scale * xx
    return np.array([xx * x + xy * y, xy * x + yy * y]), np.array([[xx, xy], [xy, yy]])


@dataclass(frozen=True, slots=True, eq=False)
class FusedPlaces:
    """The places that groups of measurements determine.

    Attributes:
        means: (G, 2).
        covariances: (G, 2, 2).
        costs: (G,) negative logs of the densities of each group's measurements, integrated over the place.
    """

    means: Floats
    covariances: Floats
    costs: Floats

    @classmethod
    def of(cls, places: Floats, covariances: Floats, groups: Sequence[Sequence[int]]) -> FusedPlaces:
        """Fuse each of the groups, not empty, of measurements (N, 2) with covariances (N, 2, 2)."""
        if not groups:
            return cls(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))
        members = np.concatenate([np.array(group) for group in groups])
        sizes = np.array([len(group) for group in groups])
        begins = np.cumsum(sizes) - sizes
        weights = inverses(covariances)[members]
        fused = inverses(np.add.reduceat(weights, begins))
        weighted = (weights @ places[members][:, :, None])[:, :, 0]
        means = (fused @ np.add.reduceat(weighted, begins)[:, :, None])[:, :, 0]
        offsets = places[members] - np.repeat(means, sizes, axis=0)
        costs = np.add.reduceat(negative_log_densities(offsets, covariances[members]), begins)
        return cls(means, fused, costs - 0.5 * np.log(determinants(fused)) - LOG_2PI)
