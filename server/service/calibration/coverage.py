"""The coverage of a calibration walk so far: by camera and pair of cameras, before the calibration itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from server.service.calibration.walk_samples import CalibrationWalk, WalkSamples

_MIN_FEET = 10
"""Foot points below which no depth ratio is computed."""


@dataclass(frozen=True, slots=True)
class CameraCoverage:
    """One camera's coverage of the walk.

    Attributes:
        camera: its name.
        shared_foot_points: foot points at compared moments at which another camera saw a person, too.
        thirds: shares of them in the left, middle and right third of the picture.
        depth_ratio: apparent height of the nearest over that of the farthest; None: too few foot points.
    """

    camera: str
    shared_foot_points: int
    thirds: tuple[float, float, float]
    depth_ratio: float | None


@dataclass(frozen=True, slots=True)
class PairCoverage:
    """For how many seconds two cameras saw a person at the same time."""

    one: str
    other: str
    seconds: float


@dataclass(frozen=True, slots=True)
class WalkCoverage:
    """The coverage of all cameras and pairs."""

    cameras: tuple[CameraCoverage, ...] = ()
    pairs: tuple[PairCoverage, ...] = ()


def walk_coverage(walks: Sequence[CalibrationWalk], seconds: float) -> WalkCoverage:
    """Return what a walk has covered; compared moments are ``seconds`` apart."""
    samples = [walk.samples for walk in walks]
    moments = 1 + max((int(sample.moment.max()) for sample in samples if sample.moment.size), default=-1)
    is_present = np.zeros((len(samples), moments), dtype=np.bool_)
    for row, sample in zip(is_present, samples, strict=True):
        row[sample.moment] = True
    count = is_present.sum(axis=0)
    cameras = [_camera(walk.camera, sample, count) for walk, sample in zip(walks, samples, strict=True)]
    both = is_present.astype(np.int64) @ is_present.T.astype(np.int64)
    pairs = [
        PairCoverage(walks[one].camera, walks[other].camera, seconds * int(both[one, other]))
        for one, other in combinations(range(len(walks)), 2)
    ]
    return WalkCoverage(tuple(cameras), tuple(pairs))


def _camera(name: str, samples: WalkSamples, count: NDArray[np.int64]) -> CameraCoverage:
    """Return one camera's coverage; ``count`` (M,) is how many cameras saw a person at each moment."""
    shared = count[samples.moment] > 1
    third, height = samples.third[shared], samples.height[shared]
    left, middle, right = (float(share) for share in np.bincount(third, minlength=3) / max(1, len(third)))
    small, large = np.quantile(height, (0.05, 0.95)) if len(height) >= _MIN_FEET else (0.0, 0.0)
    depth_ratio = float(large / small) if small > 0 else None
    return CameraCoverage(name, len(third), (left, middle, right), depth_ratio)
