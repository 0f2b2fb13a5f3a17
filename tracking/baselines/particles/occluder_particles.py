"""Occlusion as particles: the second cue of occlusion cues (Todor 2009, chapter 9).

A particle holds the share of the target that each other target hides, at least 0 and at most 1 in total; the
remaining share is visible. The thesis does not say how this extends to more than two targets. Here a particle
has one share for each nearby target. A new neighbor starts at 0. After adding noise, shares below 0 are
clipped and a sum above 1 is scaled to 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.particles.particle_filter import resample_if_degenerate
from tracking.boxes import Floats


@dataclass(slots=True)
class OccluderParticles:
    """Particles of what occludes one target.

    Attributes:
        occluder_ids: ids of the nearby targets.
        states: `(P, len(occluder_ids))`, the share that each hides.
        weights: `(P,)`, which sum to 1.
    """

    occluder_ids: tuple[int, ...]
    states: Floats
    weights: Floats

    @staticmethod
    def unoccluded(count: int) -> OccluderParticles:
        """Return particles for a target with no occluder nearby."""
        return OccluderParticles((), np.zeros((count, 0)), np.full(count, 1.0 / count))

    @property
    def visible_and_hidden_shares(self) -> Floats:
        """Each particle's visible share, then each occluder's share: `(P, 1 + occluders)`, rows sum to 1."""
        return np.column_stack([1.0 - self.states.sum(axis=1), self.states])

    @property
    def hidden_shares(self) -> Floats:
        """Each particle's share hidden by all occluders together, `(P,)`."""
        return np.asarray(self.states.sum(axis=1))

    def resample_and_propagate(
        self, rng: np.random.Generator, near: Sequence[int], noise: float, jump_share: float = 0.0
    ) -> None:
        """Resample, update the set of nearby occluders, and add noise to their shares.

        A share of `jump_share` of the particles becomes visible, and as many entirely hidden by one occluder
        (mixed states: Isard, Blake, ICCV 1998): occlusions begin and end faster than the noise can follow.
        """
        states, self.weights = resample_if_degenerate(rng, self.states, self.weights)
        known = {number: states[:, column] for column, number in enumerate(self.occluder_ids)}
        unknown = np.zeros(len(states))
        self.occluder_ids = tuple(near)
        moved = np.stack([known.get(number, unknown) for number in near], axis=1) if near else states[:, :0]
        moved = np.maximum(moved + noise * rng.standard_normal(moved.shape), 0.0)
        moved /= np.maximum(moved.sum(axis=1, keepdims=True), 1.0)
        if near:
            luck, occluder = rng.random(len(moved)), rng.integers(len(near), size=len(moved))
            moved[luck < 2 * jump_share] = 0.0
            hidden = luck < jump_share
            moved[hidden, occluder[hidden]] = 1.0
        self.states = moved
