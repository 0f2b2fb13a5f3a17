"""The coverage of a calibration walk so far: by camera and pair of cameras, before the calibration itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from server.service.calibration.walk_samples import CameraWalk, WalkSamples

_FEW = 10
"""Feet below which nothing is said of shares."""


@dataclass(frozen=True, slots=True)
class CameraCoverage:
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
class PairCoverage:
    """For how many seconds two cameras saw somebody at once."""

    one: str
    other: str
    seconds: float


@dataclass(frozen=True, slots=True)
class WalkCoverage:
    """What all of them have seen of it."""

    cameras: tuple[CameraCoverage, ...] = ()
    pairs: tuple[PairCoverage, ...] = ()


def walk_coverage(trails: Sequence[CameraWalk], seconds: float) -> WalkCoverage:
    """Return what a walk has covered; compared moments are ``seconds`` apart."""
    samples = [it.samples for it in trails]
    moments = 1 + max((int(it.moment.max()) for it in samples if it.moment.size), default=-1)
    there = np.zeros((len(samples), moments), dtype=np.bool_)
    for row, it in zip(there, samples, strict=True):
        row[it.moment] = True
    count = there.sum(axis=0)
    cameras = [_camera(trail.camera, it, count) for trail, it in zip(trails, samples, strict=True)]
    both = there.astype(np.int64) @ there.T.astype(np.int64)
    pairs = [
        PairCoverage(trails[one].camera, trails[other].camera, seconds * int(both[one, other]))
        for one, other in combinations(range(len(trails)), 2)
    ]
    return WalkCoverage(tuple(cameras), tuple(pairs))


def _camera(name: str, samples: WalkSamples, count: NDArray[np.int64]) -> CameraCoverage:
    """Return one camera's coverage; ``count`` (M,) is how many cameras saw a person at each moment."""
    shared = count[samples.moment] > 1
    third, tall = samples.third[shared], samples.tall[shared]
    left, middle, right = (float(it) for it in np.bincount(third, minlength=3) / max(1, len(third)))
    small, large = np.quantile(tall, (0.05, 0.95)) if len(tall) >= _FEW else (0.0, 0.0)
    deep = float(large / small) if small > 0 else None
    return CameraCoverage(name, len(third), (left, middle, right), deep)
