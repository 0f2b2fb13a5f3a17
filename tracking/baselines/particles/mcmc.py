"""One filter for all targets: MCMC with an interaction prior (Khan, Balch, Dellaert, ECCV 2004).

A sample is the joint state of all targets. In each image the Markov chain starts at a propagated sample of
the previous image. Then a new state is proposed for one target at a time, drawn at random,
and accepted with probability min(1, ratio) of `exp(-λ d²) Π exp(-g overlap)`: the color likelihood times the
pairwise prior against overlapping targets. Samples after the burn-in are kept for the next image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.integral_histograms import (
    ColorIntegralCache,
    ColorIntegralImage,
    color_distance,
    upper_and_lower_halves,
)
from tracking.baselines.particles.particle_filter import initial_state, particle_boxes, propagate
from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.detectors.base import Image

_LAMBDA, _OVERLAP_WEIGHT = 20.0, 8.0
_MAX_DISTANCE = 0.5
"""Mean squared color distance above which a target counts as lost."""


@dataclass(frozen=True, slots=True)
class McmcSettings:
    """The Markov chain.

    Raises:
        ValueError: a setting is out of range.
    """

    samples: int = 60  # samples kept per image
    thinning: int = 2  # proposals per target between two samples
    burn_in: int = 20  # proposals per target before the first sample
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if self.samples < 1 or self.thinning < 1 or self.burn_in < 0:
            raise ValueError("samples and thinning must be at least 1, burn_in at least 0")


@dataclass(slots=True)
class McmcTarget:
    """State of one target.

    Attributes:
        colors: `(2, 64)` of the upper and the lower half.
        aspect: width over height.
        states: `(P, 5)`, the samples: center, height and velocity, in pixels.
        box: `(4,)`, the mean box.
    """

    colors: Floats
    aspect: float
    states: Floats
    box: Floats


class McmcFilter:
    """Joint particle filter of all targets with a pairwise prior against overlaps."""

    name = "mcmc"
    uses_image = True

    def __init__(self, settings: McmcSettings | None = None) -> None:
        self._settings = settings or McmcSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._colors = ColorIntegralCache()

    def initialize(self, image: Image, box: Floats) -> McmcTarget:
        """Create a target with the colors in its box."""
        start, aspect = initial_state(box)
        colors = self._colors.get(image).histograms(upper_and_lower_halves(box))
        return McmcTarget(colors, aspect, np.tile(start, (self._settings.samples, 1)), box.copy())

    def predict(self, image: Image | None, targets: Sequence[McmcTarget]) -> Floats:
        """Run the Markov chain: `(N, 4)`, NaN for lost targets."""
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None or not targets:
            return boxes
        integral, before = self._colors.get(image), np.stack([target.states for target in targets], axis=1)
        samples, distances = self._chain(integral, targets, before)
        for row, target in enumerate(targets):
            target.states = samples[:, row]
            target.box = particle_boxes(target.states.mean(axis=0), target.aspect)
            if float(distances[:, row].mean()) <= _MAX_DISTANCE:
                boxes[row] = target.box
        return boxes

    def update(self, target: McmcTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box

    def _chain(
        self, integral: ColorIntegralImage, targets: Sequence[McmcTarget], before: Floats
    ) -> tuple[Floats, Floats]:
        """Run the chain; return its samples `(P, N, 5)` and color distances `(P, N)`."""
        count, settings, rng = len(targets), self._settings, self._rng
        steps = (settings.burn_in + settings.thinning * settings.samples) * count
        moving = rng.integers(count, size=steps)
        # Proposals do not depend on the chain's state: all are drawn and compared at once.
        proposed = propagate(rng, before[rng.integers(len(before), size=steps), moving])
        aspects = np.array([target.aspect for target in targets])
        boxes = particle_boxes(proposed, aspects[moving])
        new_distances = np.empty(steps)
        for row, target in enumerate(targets):
            moves = moving == row
            new_distances[moves] = color_distance(integral, boxes[moves], target.colors)
        log_uniform = np.log(rng.random(steps))
        state = propagate(rng, before[rng.integers(len(before))])
        current = particle_boxes(state, aspects)
        current_distances = np.array(
            [float(color_distance(integral, current[n], target.colors)) for n, target in enumerate(targets)]
        )
        samples, distances = (
            np.empty((settings.samples, count, state.shape[1])),
            np.empty((settings.samples, count)),
        )
        for step in range(steps):
            n = moving[step]
            gain = _LAMBDA * (current_distances[n] - new_distances[step])
            if count > 1:
                others = np.delete(current, n, axis=0)
                gain += _OVERLAP_WEIGHT * float((iou(current[n], others) - iou(boxes[step], others)).sum())
            if log_uniform[step] < gain:
                state[n], current[n], current_distances[n] = (
                    proposed[step],
                    boxes[step],
                    new_distances[step],
                )
            index, remainder = divmod(step + 1 - settings.burn_in * count, settings.thinning * count)
            if index >= 1 and not remainder:
                samples[index - 1], distances[index - 1] = state, current_distances
        return samples, distances
