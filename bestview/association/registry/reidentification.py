"""Matching by appearance alone: people who left long ago, or who arrive at another camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.appearance.equalized_histograms import CDF_POINTS, HistogramEqualizer, cdf_distances
from bestview.association.appearance.mean_histograms import PersonAppearance

Floats = NDArray[np.float64]

_AMBIGUITY_RATIO = 1.5
"""How many times further the second best must be before appearance alone decides."""
_FORBIDDEN_COST = 1e6


def match_by_appearance(
    equalizer: HistogramEqualizer,
    new: Sequence[PersonAppearance],
    lost: Sequence[PersonAppearance],
    possible: NDArray[np.bool_],
    gate: float,
    distance_factor: Floats | float = 1.0,
) -> list[int]:
    """Match new people with lost people by appearance, in one linear assignment.

    A match counts only if no other candidate is nearly as similar: a wrong id is worse than a new one.

    Args:
        equalizer: compares histograms of different cameras.
        new: N of them.
        lost: L of them.
        possible: (N, L); False: certainly not one person.
        gate: distance below which two appearances are likely of one person.
        distance_factor: (N, L) factor on the distances, for other evidence.

    Returns:
        For each new person the index of the lost one, or -1.
    """
    if not new or not lost:
        return [-1] * len(new)
    distance = np.where(possible, appearance_distances(equalizer, new, lost) * distance_factor, np.nan)
    acceptable = unambiguous_minima(distance, _AMBIGUITY_RATIO) & (distance <= gate)
    row, column = scipy.optimize.linear_sum_assignment(np.where(acceptable, distance, _FORBIDDEN_COST))
    matches = [-1] * len(new)
    for i, j in zip(row.tolist(), column.tolist(), strict=True):
        if acceptable[i, j]:
            matches[i] = j
    return matches


def unambiguous_minima(cost: Floats, ratio: float) -> NDArray[np.bool_]:
    """Return where an entry is the least of its row and column, and the next is `ratio` times as large.

    NaN and infinite entries do not compete.
    """
    filled = np.where(np.isnan(cost), np.inf, cost)
    unambiguous = np.isfinite(filled)
    for axis in (0, 1):
        if cost.shape[axis] > 1:
            two = np.sort(filled, axis=axis)
            least, second = np.take(two, [0], axis=axis), np.take(two, [1], axis=axis)
            unambiguous &= (filled == least) & (second >= ratio * least)
    return unambiguous


@dataclass(frozen=True, slots=True)
class _EqualizedCurves:
    """Equalized histograms of P people, L in all, sorted by person and camera.

    Attributes:
        owner: (L,) which of the people.
        camera: (L,) names.
        bins: (L,) of the histogram; only equal numbers can be compared.
        curves: (L, 33) equalized cumulative histograms.
    """

    owner: NDArray[np.int64]
    camera: NDArray[np.str_]
    bins: NDArray[np.int64]
    curves: Floats

    @classmethod
    def of(cls, appearances: HistogramEqualizer, people: Sequence[PersonAppearance]) -> _EqualizedCurves:
        entries = [
            (i, c, histogram)
            for i, appearance in enumerate(people)
            for c, histogram in sorted(appearance.by_camera.items())
        ]
        rows_by_kind: dict[tuple[str, int], list[int]] = {}
        for row, (_, camera, histogram) in enumerate(entries):
            rows_by_kind.setdefault((camera, histogram.histogram_sum.size), []).append(row)
        curves = np.zeros((len(entries), CDF_POINTS))
        for (camera, _), rows in rows_by_kind.items():
            curves[rows] = appearances.equalize(camera, np.array([entries[row][2].mean for row in rows]))
        return cls(
            owner=np.array([i for i, _, _ in entries], dtype=np.int64),
            camera=np.array([camera for _, camera, _ in entries], dtype=np.str_),
            bins=np.array([histogram.histogram_sum.size for _, _, histogram in entries], dtype=np.int64),
            curves=curves,
        )


def appearance_distances(
    appearances: HistogramEqualizer, new: Sequence[PersonAppearance], old: Sequence[PersonAppearance]
) -> Floats:
    """(N, L) appearance distances, in common cameras where there are such; NaN: unknown."""
    new_curves, old_curves = _EqualizedCurves.of(appearances, new), _EqualizedCurves.of(appearances, old)
    # Sums by pair of people, and how many looks went into them: in common cameras, and in any.
    total, count, common = (np.zeros((2, len(new), len(old))) for _ in range(3))
    for owner, camera, bins, curve in zip(
        new_curves.owner, new_curves.camera, new_curves.bins, new_curves.curves, strict=True
    ):
        distance = cdf_distances(curve, old_curves.curves)
        for kind, comparable in enumerate(
            (old_curves.camera == camera, np.ones(old_curves.owner.size, dtype=np.bool_))
        ):
            fits = comparable & (old_curves.bins == bins)
            total[kind, owner] += np.bincount(old_curves.owner[fits], distance[fits], minlength=len(old))
            count[kind, owner] += np.bincount(old_curves.owner[fits], minlength=len(old))
            common[kind, owner] += np.bincount(old_curves.owner[comparable], minlength=len(old))
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return np.asarray(np.where(common[0] > 0, mean[0], mean[1]))
