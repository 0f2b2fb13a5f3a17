"""One particle filter over the joint state of all targets (Isard, MacCormick, ICCV 2001; Todor 2009, 5.4).

A particle holds the boxes of all targets, and has one weight. So it knows who hides whom, which independent
filters cannot: of two boxes the one with the lower foot is nearer, and hides what they share. With v the
visible share of a target and d² its color distance, a particle has the likelihood

    exp(-λ Σ over targets of (v d² + (1 - v) d0²))

What is hidden says nothing, at the price d0² that keeps boxes from hiding behind each other. The particles
that are needed grow exponentially with the number of targets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.integral_histograms import ColorIntegralCache, color_distance, upper_and_lower_halves
from tracking.baselines.particles.particle_filter import (
    ParticleTarget,
    initial_state,
    particle_boxes,
    propagate,
    systematic_resample,
)
from tracking.boxes import BOX_SIDES, Floats, areas, intersections
from tracking.detectors.base import Image

_MAX_DISTANCE = 0.5
"""Mean squared color distance of what is visible above which a target counts as lost."""


@dataclass(frozen=True, slots=True)
class JointParticleSettings:
    """Settings of the joint filter.

    Raises:
        ValueError: a setting is out of range.
    """

    particles: int = 800  # of joint states
    sharpness: float = 20.0  # λ
    hidden_distance: float = 0.3  # d0²: squared color distance of what is hidden
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if self.particles < 1:
            raise ValueError(f"particles must be at least 1, not {self.particles}")
        if self.sharpness <= 0.0 or not 0.0 <= self.hidden_distance <= 1.0:
            raise ValueError("sharpness must be above 0, hidden_distance between 0 and 1")


class JointParticles:
    """Particles of joint states with shared weights. A target's `states` are its part of all particles."""

    name = "joint-particles"
    uses_image = True

    def __init__(self, settings: JointParticleSettings | None = None) -> None:
        self._settings = settings or JointParticleSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._colors = ColorIntegralCache()
        self._weights = np.full(self._settings.particles, 1.0 / self._settings.particles)

    def initialize(self, image: Image, box: Floats) -> ParticleTarget:
        """Create a target from the colors in its box; it is at the box in all particles."""
        count, (start, aspect) = self._settings.particles, initial_state(box)
        colors = self._colors.get(image).histograms(upper_and_lower_halves(box))
        return ParticleTarget(colors, aspect, np.tile(start, (count, 1)), self._weights, box.copy())

    def predict(self, image: Image | None, targets: Sequence[ParticleTarget]) -> Floats:
        """Propagate and weigh the joint particles; return `(N, 4)`, NaN for lost targets.

        Targets that are not given any more are marginalized: their part of the particles is dropped.
        """
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None or not targets:
            return boxes
        aspects = np.array([target.aspect for target in targets])
        integral, distances, visible = self._colors.get(image), np.empty(0), np.empty(0)

        def log_likelihood(states: Floats) -> Floats:
            nonlocal distances, visible
            found = particle_boxes(states, aspects)
            distances = np.stack(
                [color_distance(integral, found[:, n], target.colors) for n, target in enumerate(targets)],
                axis=1,
            )
            visible = visible_shares(found)
            costs = visible * distances + (1.0 - visible) * self._settings.hidden_distance
            return np.asarray(-self._settings.sharpness * costs.sum(axis=1))

        states, self._weights = advance_jointly(
            self._rng,
            np.stack([target.states for target in targets], axis=1),
            self._weights,
            propagate,
            log_likelihood,
        )
        for row, target in enumerate(targets):
            target.states, target.weights = states[:, row], self._weights
            target.box = particle_boxes(self._weights @ target.states, target.aspect)
            seen = self._weights * visible[:, row]
            if float(seen @ distances[:, row]) <= _MAX_DISTANCE * float(seen.sum()):
                boxes[row] = target.box
        return boxes

    def update(self, target: ParticleTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box


def advance_jointly(
    rng: np.random.Generator,
    states: Floats,
    weights: Floats,
    move: Callable[[np.random.Generator, Floats], Floats],
    log_likelihood: Callable[[Floats], Floats],
) -> tuple[Floats, Floats]:
    """Advance a joint particle filter by one image: resample, move, weigh.

    Args:
        rng: random numbers.
        states: `(P, N, S)`, joint states of N targets.
        weights: `(P,)`, which sum to 1.
        move: draws the next states from the motion model.
        log_likelihood: log likelihood `(P,)` of joint states.

    Returns:
        The next states and weights. Particles are resampled, as a whole, if their effective number is below
        half.
    """
    count = len(weights)
    if 1.0 / float(np.square(weights).sum()) < count / 2:
        states, weights = states[systematic_resample(rng, weights)], np.full(count, 1.0 / count)
    states = move(rng, states)
    logs = log_likelihood(states)
    weights = weights * np.exp(logs - logs.max())
    return states, np.asarray(weights / weights.sum())


def visible_shares(boxes: Floats) -> Floats:
    """Return the share of each box `(P, N, 4)` that no nearer box of its particle hides: `(P, N)`.

    A box with a lower lower edge is nearer; of equal ones, the first. Areas hidden twice count twice.
    """
    feet = boxes[..., 3]
    order = np.arange(boxes.shape[1])
    nearer = (feet[:, None, :] > feet[:, :, None]) | (
        (feet[:, None, :] == feet[:, :, None]) & (order[None, None, :] < order[None, :, None])
    )
    shared = np.where(nearer, intersections(boxes[:, :, None], boxes[:, None]), 0.0).sum(axis=-1)
    return np.asarray(1.0 - np.minimum(shared / np.maximum(areas(boxes), 1e-9), 1.0))
