"""Independent color particle filters (Pérez et al., ECCV 2002; Nummiaro et al. 2003).

A particle is a box: center, height and velocity. It is propagated with noise that grows with its height,
and weighted by `exp(-λ d²)`, where d is the Bhattacharyya distance of the colors in its upper and lower
halves from the target's reference. Particles are resampled when their effective number falls below half.
Filters do not interact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.integral_histograms import ColorIntegralCache, color_distance, upper_and_lower_halves
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_LAMBDA = 20.0
_STEP_NOISE, _HEIGHT_NOISE = 0.04, 0.01
"""Standard deviation of the noise of velocity and height, in heights."""
_DAMPING = 0.8
"""Share of the velocity that is kept in the next frame."""
_MAX_DISTANCE = 0.5
"""Mean squared color distance above which the target counts as lost."""


@dataclass(frozen=True, slots=True)
class ParticleSettings:
    """Number of particles, and the seed of their noise.

    Raises:
        ValueError: `particles` is below 1.
    """

    particles: int = 150  # per target
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if self.particles < 1:
            raise ValueError(f"particles must be at least 1, not {self.particles}")


@dataclass(slots=True)
class ParticleTarget:
    """State of one target.

    Attributes:
        colors: `(2, 64)` of the upper and the lower half.
        aspect: width over height.
        states: `(P, 5)`: center, height and velocity, in pixels.
        weights: `(P,)`, which sum to 1.
        box: `(4,)`, the mean box.
    """

    colors: Floats
    aspect: float
    states: Floats
    weights: Floats
    box: Floats


class ParticleFilters:
    """Independent color particle filters."""

    name = "particle"
    uses_image = True

    def __init__(self, settings: ParticleSettings | None = None) -> None:
        self._settings = settings or ParticleSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._colors = ColorIntegralCache()

    def initialize(self, image: Image, box: Floats) -> ParticleTarget:
        """Create a target from the colors in its box, with all particles at the box."""
        count, (start, aspect) = self._settings.particles, initial_state(box)
        colors = self._colors.get(image).histograms(upper_and_lower_halves(box))
        return ParticleTarget(
            colors, aspect, np.tile(start, (count, 1)), np.full(count, 1 / count), box.copy()
        )

    def predict(self, image: Image | None, targets: Sequence[ParticleTarget]) -> Floats:
        """Propagate and weigh the particles; return `(N, 4)`, NaN for lost targets."""
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        for row, target in enumerate(targets):
            self._propagate(target)
            distance = color_distance(
                self._colors.get(image), particle_boxes(target.states, target.aspect), target.colors
            )
            target.weights = reweight(target.weights, distance, _LAMBDA)
            target.box = particle_boxes(target.weights @ target.states, target.aspect)
            if float(target.weights @ distance) <= _MAX_DISTANCE:
                boxes[row] = target.box
        return boxes

    def update(self, target: ParticleTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box

    def _propagate(self, target: ParticleTarget) -> None:
        """Resample if degenerate, and propagate the particles."""
        states, target.weights = resample_if_degenerate(self._rng, target.states, target.weights)
        target.states = propagate(self._rng, states)


def initial_state(box: Floats) -> tuple[Floats, float]:
    """Return the state `(5,)` of a standing person in a box `(4,)`, and its aspect ratio."""
    height = max(box[3] - box[1], 1.0)
    state = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, height, 0.0, 0.0])
    return state, (box[2] - box[0]) / height


def reweight(weights: Floats, distance: Floats, sharpness: float) -> Floats:
    """Multiply particle weights `(P,)` by their likelihood of distances `(P,)`, and normalize them."""
    # Relative to the best particle, so that a loss common to all (a shadow, an occluder) does not count.
    updated = weights * np.exp(-sharpness * (distance - distance.min()))
    return np.asarray(updated / updated.sum())


def propagate(rng: np.random.Generator, states: Floats) -> Floats:
    """Propagate particles `(..., 5)` with their velocity and noise."""
    noise = rng.standard_normal((*states.shape[:-1], 3)) * states[..., 2:3]
    moved = states.copy()
    moved[..., 3:] = _DAMPING * states[..., 3:] + _STEP_NOISE * noise[..., :2]
    moved[..., :2] += moved[..., 3:]
    moved[..., 2] = np.maximum(states[..., 2] + _HEIGHT_NOISE * noise[..., 2], 1.0)
    return moved


def particle_boxes(states: Floats, aspect: float | Floats) -> Floats:
    """Return the boxes of particles `(..., 5)`, `(..., 4)`."""
    x, y, height = states[..., 0], states[..., 1], states[..., 2]
    width = height * aspect
    return np.stack([x - width / 2, y - height / 2, x + width / 2, y + height / 2], axis=-1)


Indices = NDArray[np.intp]


def systematic_resample(rng: np.random.Generator, weights: Floats) -> Indices:
    """Return the indices `(P,)` of systematic resampling by weights `(P,)`, which sum to 1."""
    count = len(weights)
    positions = (rng.random() + np.arange(count)) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), positions), count - 1)


def resample_if_degenerate(
    rng: np.random.Generator, states: Floats, weights: Floats
) -> tuple[Floats, Floats]:
    """Return particles `(P, S)` and weights `(P,)`, resampled if the effective number is below half."""
    count = len(weights)
    if 1.0 / float(np.square(weights).sum()) >= count / 2:
        return states, weights
    return states[systematic_resample(rng, weights)], np.full(count, 1.0 / count)
