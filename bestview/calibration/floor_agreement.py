"""How well two cameras that are placed on one floor agree about who stands where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import Pinhole
from bestview.calibration.samples import CandidateMatches, WalkSamples
from bestview.calibration.walk_settings import WalkSettings


@dataclass(frozen=True, slots=True)
class FloorPositions:
    """One camera's samples on the floor.

    Attributes:
        position: where each stands, (S, 2) person heights; NaN where nowhere.
        covariance: how badly that is known: east-east, east-north and north-north covariances, (S, 3).
    """

    position: Floats
    covariance: Floats

    def transformed(self, turn: float, shift: Floats) -> FloorPositions:
        """Turn about the origin (radians), then shift (2,)."""
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


def project_to_floor(camera: Pinhole, feet: Floats, tall: Floats, settings: WalkSettings) -> FloorPositions:
    """Put feet (S, 2) of boxes so tall (S,) on the floor."""
    place, steps = camera.floor_and_steps(feet)
    across = steps[..., 0] * (settings.foot_sideways * tall)[:, None]
    along = steps[..., 1] * (settings.foot_upwards * tall)[:, None]
    spread = np.column_stack(
        [
            across[:, 0] ** 2 + along[:, 0] ** 2,
            across[:, 0] * across[:, 1] + along[:, 0] * along[:, 1],
            across[:, 1] ** 2 + along[:, 1] ** 2,
        ]
    )
    return FloorPositions(place, spread)


def whitened_differences(one: FloorPositions, other: FloorPositions, settings: WalkSettings) -> Floats:
    """How far apart places are, whitened: (P, 2), whose length is in standard deviations; NaN if nowhere."""
    far = one.position - other.position
    ee, en, nn = (one.covariance + other.covariance).T
    ee, nn = ee + settings.foot_floor**2, nn + settings.foot_floor**2
    # Cholesky: with L Lᵀ the covariance, L⁻¹ of the distance.
    first = np.sqrt(ee)
    below = en / first
    second = np.sqrt(np.maximum(nn - below**2, 1e-12))
    x = far[:, 0] / first
    return np.column_stack([x, (far[:, 1] - below * x) / second])


def select_positions(placed_: FloorPositions, index: NDArray[np.intp]) -> FloorPositions:
    """Give some of the samples, in another order or repeated."""
    return FloorPositions(placed_.position[index], placed_.covariance[index])


def pair_agreement(off: Floats, meeting: CandidateMatches, gate: float) -> Floats:
    """Count places at which each pair of tracks agrees, less those at which not: (P, 2) -> (K,)."""
    near = 1.0 - (off**2).sum(axis=1) / gate**2
    counted = np.clip(np.nan_to_num(near, nan=-1.0), -1.0, 1.0) * meeting.weight
    return np.asarray(np.bincount(meeting.pair, counted, len(meeting.tracks)))


def total_agreement(places: Floats, meeting: CandidateMatches) -> float:
    """Count places at which the cameras agree on the whole; each track has one partner."""
    agree = np.maximum(places, 0.0)
    totals = []
    for side in meeting.tracks.T:
        best = np.zeros(int(side.max(initial=0)) + 1)
        np.maximum.at(best, side, agree)
        totals.append(float(best.sum()))
    return min(totals)


def mutual_matches(
    off: Floats, places: Floats, one: WalkSamples, other: WalkSamples, meeting: CandidateMatches, gate: float
) -> NDArray[np.intp]:
    """Choose who is one person: (M,) indices of meetings, one to one at each pulse.

    Two samples are matched if they are near each other, and if their tracks agree more than either's does
    with anybody else who is there at that pulse.
    """
    agree = places[meeting.pair]
    best_here, best_there = np.zeros(len(one.times)), np.zeros(len(other.times))
    np.maximum.at(best_here, meeting.here, agree)
    np.maximum.at(best_there, meeting.there, agree)
    near = (off**2).sum(axis=1) < gate**2
    mutual = (agree > 0) & (agree >= best_here[meeting.here]) & (agree >= best_there[meeting.there])
    return np.flatnonzero(near & mutual)
