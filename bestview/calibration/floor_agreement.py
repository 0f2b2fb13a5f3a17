"""How well two cameras on one floor agree about people's positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import Pinhole
from bestview.calibration.samples import CandidateMatches, Indices, WalkSamples
from bestview.calibration.walk_settings import WalkSettings

_EDGE = 0.04
"""Share of the picture at each edge where people may be cut off."""
_SMALL = 0.06
"""Share of the picture's height below which detection is unreliable."""


@dataclass(frozen=True, slots=True)
class FloorPositions:
    """One camera's samples on the floor.

    Attributes:
        position: (S, 2) person heights; NaN: off the floor.
        covariance: (S, 3) east-east, east-north and north-north.
    """

    position: Floats
    covariance: Floats

    def transformed(self, turn: float, shift: Floats) -> FloorPositions:
        """Rotate about the origin (radians), then translate (2,)."""
        cos, sin = np.cos(turn), np.sin(turn)
        east, north = self.position.T
        ee, en, nn = self.covariance.T
        place = np.column_stack([cos * east - sin * north, sin * east + cos * north]) + shift
        spread = np.column_stack(
            [
                cos * cos * ee - 2 * cos * sin * en + sin * sin * nn,
                cos * sin * (ee - nn) + (cos * cos - sin * sin) * en,
                sin * sin * ee + 2 * cos * sin * en + cos * cos * nn,
            ]
        )
        return FloorPositions(place, spread)


def project_to_floor(
    camera: Pinhole, feet: Floats, heights: Floats, settings: WalkSettings
) -> FloorPositions:
    """Project foot points (S, 2) of boxes with heights (S,) to the floor."""
    place, steps = camera.floor_and_steps(feet)
    across = steps[..., 0] * (settings.foot_sideways * heights)[:, None]
    along = steps[..., 1] * (settings.foot_upwards * heights)[:, None]
    spread = np.column_stack(
        [
            across[:, 0] ** 2 + along[:, 0] ** 2,
            across[:, 0] * across[:, 1] + along[:, 0] * along[:, 1],
            across[:, 1] ** 2 + along[:, 1] ** 2,
        ]
    )
    return FloorPositions(place, spread)


def whitened_differences(first: FloorPositions, second: FloorPositions, settings: WalkSettings) -> Floats:
    """Compute whitened differences of positions: (P, 2), in standard deviations; NaN: off the floor."""
    difference = first.position - second.position
    ee, en, nn = (first.covariance + second.covariance).T
    ee, nn = ee + settings.foot_floor**2, nn + settings.foot_floor**2
    # Cholesky: with L Lᵀ the covariance, L⁻¹ of the distance.
    root_ee = np.sqrt(ee)
    off_diagonal = en / root_ee
    root_nn = np.sqrt(np.maximum(nn - off_diagonal**2, 1e-12))
    x = difference[:, 0] / root_ee
    return np.column_stack([x, (difference[:, 1] - off_diagonal * x) / root_nn])


def select_positions(positions: FloorPositions, index: NDArray[np.intp]) -> FloorPositions:
    """Return some of the samples, in another order or repeated."""
    return FloorPositions(positions.position[index], positions.covariance[index])


def track_pair_agreement(distances: Floats, candidates: CandidateMatches, gate: float) -> Floats:
    """Count places at which each pair of tracks agrees, minus those at which it does not: (P, 2) -> (K,)."""
    closeness = 1.0 - (distances**2).sum(axis=1) / gate**2
    votes = np.clip(np.nan_to_num(closeness, nan=-1.0), -1.0, 1.0) * candidates.weight
    return np.asarray(np.bincount(candidates.track_pair, votes, len(candidates.tracks)))


def total_agreement(pair_agreement: Floats, candidates: CandidateMatches) -> float:
    """Count places at which the cameras agree in total, from the agreement of each pair of tracks, (K,).

    A track counts with its best partner only.
    """
    agreement = np.maximum(pair_agreement, 0.0)
    totals = []
    for side in candidates.tracks.T:
        best = np.zeros(int(side.max(initial=0)) + 1)
        np.maximum.at(best, side, agreement)
        totals.append(float(best.sum()))
    return min(totals)


def mutual_matches(
    distances: Floats,
    pair_agreement: Floats,
    first: WalkSamples,
    second: WalkSamples,
    candidates: CandidateMatches,
    gate: float,
) -> NDArray[np.intp]:
    """Match samples one to one at each pulse: (M,) indices of candidates.

    Two samples are matched if they are near each other, and if their tracks agree more than either does with
    any other track that is present at that pulse.
    """
    agreement = pair_agreement[candidates.track_pair]
    best_here, best_there = np.zeros(len(first.times)), np.zeros(len(second.times))
    np.maximum.at(best_here, candidates.here, agreement)
    np.maximum.at(best_there, candidates.there, agreement)
    near = (distances**2).sum(axis=1) < gate**2
    mutual = (
        (agreement > 0)
        & (agreement >= best_here[candidates.here])
        & (agreement >= best_there[candidates.there])
    )
    return np.flatnonzero(near & mutual)


def covisible_agreement(
    cameras: Sequence[Pinhole], samples: Sequence[WalkSamples], chosen: Sequence[Indices]
) -> float:
    """Return the matched share of the samples that both cameras could see: geometric mean of both, 0 to 1.

    Args:
        cameras: the two cameras.
        samples: of each camera.
        chosen: (M,) indices of the matched samples of each camera.
    """
    agreements = []
    for own, index in ((0, chosen[0]), (1, chosen[1])):
        other = 1 - own
        covisible = fully_detectable(cameras[own], samples[own], cameras[other])
        if len(samples[other].times):
            covisible &= samples[own].times >= samples[other].times.min()
            covisible &= samples[own].times <= samples[other].times.max()
        agreed = np.zeros(len(covisible), dtype=bool)
        agreed[index] = True
        weight = samples[own].weight
        agreements.append(weight[agreed].sum() / max(weight[covisible | agreed].sum(), 1e-9))
    return float(np.sqrt(agreements[0] * agreements[1]))


def fully_detectable(camera: Pinhole, samples: WalkSamples, other: Pinhole) -> NDArray[np.bool_]:
    """Return which samples the other camera shows completely and large enough to be detected: (S,)."""
    feet = other.picture(camera.floor(samples.feet))
    heights = other.heights(feet)
    width, height = other.size
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (np.abs(feet[:, 0] - width / 2) < width * (0.5 - _EDGE))
            & (feet[:, 1] < height * (1 - _EDGE))
            & (feet[:, 1] - heights > height * _EDGE)
            & (heights > height * _SMALL)
        )
