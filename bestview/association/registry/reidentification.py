"""Finding again, by looks alone, who left long ago or has come to a camera that has not seen them yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.appearance.equalized_histograms import POINTS, Appearances, distances
from bestview.association.appearance.mean_histograms import Looks

Floats = NDArray[np.float64]

_RATIO = 1.5
"""How many times further the second likeliest must be before appearance alone decides."""
_NEVER = 1e6


def find_again(
    appearances: Appearances,
    found: Sequence[Looks],
    lost: Sequence[Looks],
    possible: NDArray[np.bool_],
    gate: float,
    in_time: Floats | float = 1.0,
) -> list[int]:
    """Say who of those who are `lost` each newly `found` person is: their index, or -1.

    Only where nobody else looks nearly as like: a wrong number is worse than a new one. One assignment.

    Args:
        appearances: to compare looks with.
        found: N of them.
        lost: L of them.
        possible: (N, L); where False the two are surely not one.
        gate: distance below which two looks are likely one person's.
        in_time: (N, L) what distances are multiplied by, for what else is known.
    """
    if not found or not lost:
        return [-1] * len(found)
    apart = np.where(possible, unlike(appearances, found, lost) * in_time, np.nan)
    good = clearly_least(apart, _RATIO) & (apart <= gate)
    row, column = scipy.optimize.linear_sum_assignment(np.where(good, apart, _NEVER))
    answer = [-1] * len(found)
    for i, j in zip(row.tolist(), column.tolist(), strict=True):
        if good[i, j]:
            answer[i] = j
    return answer


def clearly_least(cost: Floats, ratio: float) -> NDArray[np.bool_]:
    """Where a finite entry is the least of its row and column, and the next is `ratio` times as large.

    NaN and infinite entries do not compete.
    """
    filled = np.where(np.isnan(cost), np.inf, cost)
    clear = np.isfinite(filled)
    for axis in (0, 1):
        if cost.shape[axis] > 1:
            two = np.sort(filled, axis=axis)
            least, second = np.take(two, [0], axis=axis), np.take(two, [1], axis=axis)
            clear &= (filled == least) & (second >= ratio * least)
    return clear


@dataclass(frozen=True, slots=True)
class _Curves:
    """How P people look, L looks in all, sorted by person and camera.

    Attributes:
        owner: (L,) which of the people.
        camera: (L,) names.
        bins: (L,) of the histogram; looks with others cannot be compared.
        curves: (L, 33) equalised cumulative histograms.
    """

    owner: NDArray[np.int64]
    camera: NDArray[np.str_]
    bins: NDArray[np.int64]
    curves: Floats

    @classmethod
    def of(cls, appearances: Appearances, people: Sequence[Looks]) -> _Curves:
        every = [
            (i, c, look) for i, looks in enumerate(people) for c, look in sorted(looks.by_camera.items())
        ]
        alike: dict[tuple[str, int], list[int]] = {}
        for row, (_, camera, look) in enumerate(every):
            alike.setdefault((camera, look.total.size), []).append(row)
        curves = np.zeros((len(every), POINTS))
        for (camera, _), rows in alike.items():
            curves[rows] = appearances.equalised(camera, np.array([every[row][2].mean for row in rows]))
        return cls(
            owner=np.array([i for i, _, _ in every], dtype=np.int64),
            camera=np.array([camera for _, camera, _ in every], dtype=np.str_),
            bins=np.array([look.total.size for _, _, look in every], dtype=np.int64),
            curves=curves,
        )


def unlike(appearances: Appearances, found: Sequence[Looks], lost: Sequence[Looks]) -> Floats:
    """(N, L) appearance distances, in common cameras where there are such; NaN: unknown."""
    new, old = _Curves.of(appearances, found), _Curves.of(appearances, lost)
    # Sums by pair of people, and how many looks went into them: in common cameras, and in any.
    total, count, common = (np.zeros((2, len(found), len(lost))) for _ in range(3))
    for owner, camera, bins, curve in zip(new.owner, new.camera, new.bins, new.curves, strict=True):
        apart = distances(curve, old.curves)
        for kind, here in enumerate((old.camera == camera, np.ones(old.owner.size, dtype=np.bool_))):
            fits = here & (old.bins == bins)
            total[kind, owner] += np.bincount(old.owner[fits], apart[fits], minlength=len(lost))
            count[kind, owner] += np.bincount(old.owner[fits], minlength=len(lost))
            common[kind, owner] += np.bincount(old.owner[here], minlength=len(lost))
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return np.asarray(np.where(common[0] > 0, mean[0], mean[1]))
