"""How people look, compared all with all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.appearance import POINTS, Appearances, distances
from bestview.persons import Person


@dataclass(frozen=True, slots=True)
class _Looks:
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
    curves: NDArray[np.float64]


def _looks(appearances: Appearances, people: Sequence[Person]) -> _Looks:
    every = [(i, c, look) for i, person in enumerate(people) for c, look in sorted(person.looks.items())]
    alike: dict[tuple[str, int], list[int]] = {}
    for row, (_, camera, look) in enumerate(every):
        alike.setdefault((camera, look.total.size), []).append(row)
    curves = np.zeros((len(every), POINTS))
    for (camera, _), rows in alike.items():
        means = np.array([every[row][2].total / every[row][2].count for row in rows])
        curves[rows] = appearances.equalised(camera, means)
    return _Looks(
        owner=np.array([i for i, _, _ in every], dtype=np.int64),
        camera=np.array([camera for _, camera, _ in every], dtype=np.str_),
        bins=np.array([look.total.size for _, _, look in every], dtype=np.int64),
        curves=curves,
    )


def unlike(appearances: Appearances, found: Sequence[Person], lost: Sequence[Person]) -> NDArray[np.float64]:
    """(N, L) appearance distances, in common cameras where there are such; NaN: unknown."""
    new, old = _looks(appearances, found), _looks(appearances, lost)
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
