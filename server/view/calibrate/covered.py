"""What a walk has covered so far, as far as it can be told before it is calibrated from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from server.view.calibrate.trail import Trail

_FEW = 10
"""Feet below which nothing is said of shares."""


@dataclass(frozen=True, slots=True)
class CameraCovered:
    """What one camera has seen of it.

    Attributes:
        camera: its name.
        feet: feet seen while another camera saw somebody, too, at the moments that are compared.
        thirds: what shares of them were in the left, middle and right third of the picture; 0 of none.
        deep: how many times as tall the nearest of them appear as the farthest; None: too few were seen.
    """

    camera: str
    feet: int
    thirds: tuple[float, float, float]
    deep: float | None


@dataclass(frozen=True, slots=True)
class PairCovered:
    """For how many seconds two cameras saw somebody at once."""

    one: str
    other: str
    seconds: float


def camera_covered(trail: Trail, others: Sequence[Trail]) -> CameraCovered:
    """Say what a camera has seen of the walk while another did."""
    moments, third, tall = trail.samples
    elsewhere = np.concatenate([np.zeros(0, dtype=np.int64), *(it.samples[0] for it in others)])
    both = np.isin(moments, elsewhere)
    third, tall = third[both], tall[both]
    left, middle, right = (float(it) for it in np.bincount(third, minlength=3) / max(1, len(third)))
    deep = float(np.quantile(tall, 0.95) / np.quantile(tall, 0.05)) if len(tall) >= _FEW else None
    return CameraCovered(trail.camera, len(third), (left, middle, right), deep)


def pairs_covered(trails: Sequence[Trail], seconds: float) -> list[PairCovered]:
    """Say for how long every two cameras saw somebody at once; moments are so many seconds apart."""
    moments = {it.camera: np.unique(it.samples[0]) for it in trails}
    return [
        PairCovered(
            one, other, seconds * len(np.intersect1d(moments[one], moments[other], assume_unique=True))
        )
        for one, other in combinations(moments, 2)
    ]
