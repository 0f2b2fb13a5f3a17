"""Independent color particle filters (Pérez et al., ECCV 2002; Nummiaro et al. 2003).

A particle is a box: center, height and velocity. It is propagated with noise that grows with its height,
and weighted by `exp(-λ d²)`, where d is the Bhattacharyya distance of the colors in its upper and lower
halves from the target's first ones. Particles are resampled when their effective number falls below half.
Filters do not interact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.color_integral import ColorIntegralCache, color_distance, upper_and_lower_halves
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_LAMBDA = 20.0
_STEP_NOISE, _HEIGHT_NOISE = 0.04, 0.01
"""Noise of a step and of the height, in heights."""
_DAMPING = 0.8
"""Of a step, what the next one keeps."""
_MAX_DISTANCE = 0.5
"""Mean squared distance above which nobody of these colors is among the particles."""


@dataclass(frozen=True, slots=True)
class ParticleSettings:
    """How many, and drawn by what.

    Raises:
        ValueError: there is none.
    """

    particles: int = 150  # of each object
    seed: int = 1  # of all noise

    def __post_init__(self) -> None:
        if self.particles < 1:
            raise ValueError(f"particles must be at least 1, not {self.particles}")


@dataclass(slots=True)
class ParticleTarget:
    """State of one target.

    Attributes:
        colors: `(2, 64)` of the upper and the lower half.
        aspect: width over height.
        states: `(P, 5)`: middle, height, step, in pixels.
        weights: `(P,)`, which sum to 1.
        box: `(4,)`, the mean.
    """

    colors: Floats
    aspect: float
    states: Floats
    weights: Floats
    box: Floats


class ParticleFilters:
    """Independent particle filters, the survey's basic tracker."""

    name = "particle"
    uses_image = True

    def __init__(self, settings: ParticleSettings | None = None) -> None:
        self._settings = settings or ParticleSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._colors = ColorIntegralCache()

    def initialize(self, image: Image, box: Floats) -> ParticleTarget:
        """Create a target: take its color histograms and put all particles at its box."""
        count, (start, aspect) = self._settings.particles, initial_state(box)
        colors = self._colors.get(image).histograms(upper_and_lower_halves(box))
        return ParticleTarget(
            colors, aspect, np.tile(start, (count, 1)), np.full(count, 1 / count), box.copy()
        )

    def predict(self, image: Image | None, objects: Sequence[ParticleTarget]) -> Floats:
        """Propagate and weigh the particles: `(N, 4)`, NaN where none matches its target."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        for row, item in enumerate(objects):
            self._propagate(item)
            distance = color_distance(
                self._colors.get(image), particle_boxes(item.states, item.aspect), item.colors
            )
            item.weights = reweight(item.weights, distance, _LAMBDA)
            item.box = particle_boxes(item.weights @ item.states, item.aspect)
            if float(item.weights @ distance) <= _MAX_DISTANCE:
                boxes[row] = item.box
        return boxes

    def update(self, known: ParticleTarget, box: Floats) -> Floats:  # noqa: ARG002 — the image alone decides
        """Return the target's own box: a detection does not move it."""
        return known.box

    def _propagate(self, item: ParticleTarget) -> None:
        """Resample where needed, and propagate the particles."""
        states, item.weights = resample_if_degenerate(self._rng, item.states, item.weights)
        item.states = propagate(self._rng, states)


def initial_state(box: Floats) -> tuple[Floats, float]:
    """Return the state `(5,)` of a standing person in a box `(4,)`, and its aspect ratio."""
    tall = max(box[3] - box[1], 1.0)
    state = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, tall, 0.0, 0.0])
    return state, (box[2] - box[0]) / tall


def reweight(weights: Floats, distance: Floats, sharpness: float) -> Floats:
    """Multiply particle weights `(P,)` by their likelihood of distances `(P,)`, and normalize them."""
    # Relative to the best particle: what all lack (a shadow, an occluder) does not count.
    anew = weights * np.exp(-sharpness * (distance - distance.min()))
    return np.asarray(anew / anew.sum())


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
    x, y, tall = states[..., 0], states[..., 1], states[..., 2]
    wide = tall * aspect
    return np.stack([x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2], axis=-1)


Indices = NDArray[np.intp]


def systematic_resample(rng: np.random.Generator, weights: Floats) -> Indices:
    """Return the indices `(P,)` of particles resampled by their weights `(P,)`, which sum to 1."""
    count = len(weights)
    # Systematic: one draw for all.
    marks = (rng.random() + np.arange(count)) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), marks), count - 1)


def resample_if_degenerate(
    rng: np.random.Generator, states: Floats, weights: Floats
) -> tuple[Floats, Floats]:
    """Return particles `(P, S)` and weights `(P,)`, resampled where the effective number is below half."""
    count = len(weights)
    if 1.0 / float(np.square(weights).sum()) >= count / 2:
        return states, weights
    return states[systematic_resample(rng, weights)], np.full(count, 1.0 / count)
