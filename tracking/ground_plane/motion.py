"""How people move on the plane: they walk on, or start, stop and turn; or only their feet seem to move.

A walking person's velocity changes by a random acceleration (a Kalman filter of constant velocity). Now and
then people do anything else: then any velocity is possible. And whom a single camera locates may be elsewhere
along its line of sight, for as long as it sees the feet in the wrong place. Costs are negative log densities
of the mixture of all three, so that a turn or a jump costs more than walking on, but less than leaving and
arriving again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.ground_plane.gaussians import OffsetDensities
from tracking.ground_plane.settings import GroundSettings

_MOTION_GATE = 16.0
"""Squared Mahalanobis distance, the quantile .9997, beyond which a move is impossible."""
_MAX_TURN_S = 1.5
"""Seconds after which the place of somebody who may have turned is not searched further away."""
_TURN_NOISE_M = 0.1
"""Standard deviation of the place from which somebody has turned, meters."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """Place and velocity of a person, or of each of several, along leading axes of all arrays.

    Attributes:
        mean: (..., 4) x, y in meters, and velocities in meters per second.
        covariance: (..., 4, 4).
    """

    mean: Floats
    covariance: Floats

    @classmethod
    def at(cls, place: Floats, covariance: Floats, speed: float) -> MotionState:
        """Return the state of a person at a place whose velocity is unknown."""
        joint = np.zeros((4, 4))
        joint[:2, :2], joint[2:, 2:] = covariance, speed**2 * np.eye(2)
        return cls(np.concatenate([place, np.zeros(2)]), joint)

    @classmethod
    def stack(cls, states: Sequence[MotionState]) -> MotionState:
        """Return the states of several people as one, with a leading axis."""
        means = np.array([state.mean for state in states]).reshape(-1, 4)
        return cls(means, np.array([state.covariance for state in states]).reshape(-1, 4, 4))

    @property
    def place(self) -> Floats:
        """Its place, (..., 2)."""
        return self.mean[..., :2]

    @property
    def velocity(self) -> Floats:
        """Its velocity, (..., 2)."""
        return self.mean[..., 2:]

    @property
    def place_covariance(self) -> Floats:
        """The covariance of the place, (..., 2, 2)."""
        return self.covariance[..., :2, :2]

    @property
    def velocity_covariance(self) -> Floats:
        """The covariance of the velocity, (..., 2, 2)."""
        return self.covariance[..., 2:, 2:]

    def predict(self, seconds: float | Floats, acceleration: float) -> MotionState:
        """Return the state of somebody who walks on for so many seconds, (...) or alike for all."""
        time = np.asarray(seconds)[..., None, None]
        step, noise = _identities(time, 4), np.zeros((*time.shape[:-2], 4, 2))
        step[..., :2, 2:] = time * np.eye(2)
        noise[..., :2, :], noise[..., 2:, :] = 0.5 * time**2 * np.eye(2), time * np.eye(2)
        grown = acceleration**2 * noise @ np.swapaxes(noise, -1, -2)
        return MotionState(
            (step @ self.mean[..., None])[..., 0],
            step @ self.covariance @ np.swapaxes(step, -1, -2) + grown,
        )

    def update(self, place: Floats, covariance: Floats) -> MotionState:
        """Return the state of one person after a measurement of the place."""
        gain = self.covariance[:, :2] @ np.linalg.inv(self.place_covariance + covariance)
        return MotionState(
            self.mean + gain @ (place - self.place), self.covariance - gain @ self.covariance[:2]
        )


def move_costs(walked: OffsetDensities, turned: OffsetDensities, turns: float | Floats) -> Floats:
    """Return the negative log densities of moves: of walking on, or of turning with the probability `turns`.

    Both densities are of offsets: from where somebody walks on to, and from where they were. Infinite where
    both are impossible.
    """
    walking, turning = _log_densities(walked, turned, turns)
    return np.where(is_possible(walked) | is_possible(turned), -np.logaddexp(walking, turning), np.inf)


def with_misplaced_feet(costs: Floats, jumps: OffsetDensities, probability: float | Floats) -> Floats:
    """Return the costs of moves if feet may have begun or ended to be in the wrong place, with a probability.

    `jumps`: the densities of the offsets then.
    """
    jumping = np.where(is_possible(jumps), np.log(probability) - jumps.costs, -np.inf)
    return np.asarray(-np.logaddexp(-costs, jumping))


def jump_densities(offsets: Floats, covariances: Floats, misplacements: Floats) -> OffsetDensities:
    """Return the densities of offsets (..., 2) between places of which one at least may be wrong.

    `misplacements` (..., 2, 2): covariances of the errors; where they are 0 no jump is possible.
    """
    jumps = OffsetDensities.of(offsets, covariances + misplacements)
    none = np.trace(misplacements, axis1=-2, axis2=-1) == 0.0
    return OffsetDensities(np.where(none, np.inf, jumps.distances), jumps.costs)


def is_possible(moves: OffsetDensities) -> NDArray[np.bool_]:
    """Return which moves are not too far."""
    return np.asarray(moves.distances < _MOTION_GATE)


def may_walk(places: Floats, spreads: Floats, means: Floats, covariances: Floats) -> NDArray[np.bool_]:
    """Return which of the places `means` (K, 2) people whom one expects at `places` (N, 2) may be at, (N, K).

    No possible move is left out, but some impossible ones are not: a covariance is not larger than its trace.
    """
    reach = np.trace(spreads, axis1=1, axis2=2)[:, None] + np.trace(covariances, axis1=1, axis2=2)
    distances = (means[:, 0] - places[:, :1]) ** 2 + (means[:, 1] - places[:, 1:]) ** 2
    return np.asarray(distances < _MOTION_GATE * reach)


def reach_costs(
    state: MotionState,
    seconds: float | Floats,
    means: Floats,
    covariances: Floats,
    misplacements: Floats,
    settings: GroundSettings,
) -> Floats:
    """Return the costs of people being at places (K, 2) after so many seconds, (...,), (..., K).

    `misplacements`: (..., K, 2, 2) covariances of the errors of both places if feet are wrong.
    """
    time = np.asarray(seconds)[..., None]
    ahead = state.predict(seconds, settings.acceleration)
    spread = (settings.speed * np.minimum(time, _MAX_TURN_S)[..., None]) ** 2 * np.eye(2)
    offsets = means - state.place[..., None, :]
    around = covariances + (state.place_covariance + spread)[..., None, :, :]
    walked = OffsetDensities.of(
        means - ahead.place[..., None, :], covariances + ahead.place_covariance[..., None, :, :]
    )
    costs = move_costs(walked, OffsetDensities.of(offsets, around), settings.turn_probability(time))
    jumps = jump_densities(offsets, around, misplacements)
    return with_misplaced_feet(costs, jumps, settings.misplacing_probability(time))


def follow(
    state: MotionState,
    seconds: float,
    place: Floats,
    covariance: Floats,
    misplacement: Floats,
    settings: GroundSettings,
) -> MotionState:
    """Return the state of a person who was found at a place.

    After a turn the velocity is unknown again; so it is after a jump, and the place before says nothing.
    `misplacement`: (2, 2) as in `reach_costs`.
    """
    ahead = state.predict(seconds, settings.acceleration)
    spread = (settings.speed * seconds) ** 2 * np.eye(2)
    offset, around = place - state.place, covariance + state.place_covariance + spread
    walking, turning = _log_densities(
        OffsetDensities.of(place - ahead.place, covariance + ahead.place_covariance),
        OffsetDensities.of(offset, around),
        settings.turn_probability(seconds),
    )
    jumps = jump_densities(offset, around, misplacement)
    jumping = np.log(settings.misplacing_probability(seconds)) - jumps.costs
    if is_possible(jumps) and jumping > max(walking, turning):
        return MotionState.at(place, covariance, settings.speed)
    if turning > walking:
        turned = MotionState.at(state.place, _TURN_NOISE_M**2 * np.eye(2), settings.speed)
        ahead = turned.predict(seconds, settings.acceleration)
    return ahead.update(place, covariance)


def _identities(like: Floats, size: int) -> Floats:
    """Return identity matrices along the leading axes of `like` (..., 1, 1)."""
    return np.broadcast_to(np.eye(size), (*like.shape[:-2], size, size)).copy()


def _log_densities(
    walked: OffsetDensities, turned: OffsetDensities, turns: float | Floats
) -> tuple[Floats, Floats]:
    """Return the log densities of having walked on and of having turned, each with its probability."""
    return np.log1p(-turns) - walked.costs, np.log(turns) - turned.costs
