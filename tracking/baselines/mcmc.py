"""One filter for all objects: MCMC with an interaction prior (Khan, Balch, Dellaert, ECCV 2004).

A sample is everybody's state at once. In each picture the Markov chain starts at a sample of the last one,
everybody having gone on. Then one object at a time, drawn at random, is proposed to go on otherwise, which is
accepted with probability min(1, ratio) of `exp(-λ d²) Π exp(-g overlap)`: the colors' likelihood times the
pairwise prior by which two objects seldom share a place. Samples after the burn-in are the next picture's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.color_integral import (
    ColorIntegralCache,
    ColorIntegralImage,
    color_distance,
    upper_and_lower_halves,
)
from tracking.baselines.particle_filter import initial_state, particle_boxes, propagate
from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.detectors.base import Image

_LAMBDA, _APART = 20.0, 8.0
_LOST = 0.5
"""Mean squared distance above which nobody of these colors is there."""


@dataclass(frozen=True, slots=True)
class McmcSettings:
    """The chain.

    Raises:
        ValueError: a number makes no sense.
    """

    samples: int = 60  # kept of each picture
    thinning: int = 2  # proposals for each object between two of them
    burn_in: int = 20  # proposals for each object before the first
    seed: int = 1  # of everything drawn

    def __post_init__(self) -> None:
        if self.samples < 1 or self.thinning < 1 or self.burn_in < 0:
            raise ValueError("samples and thinning must be at least 1, burn_in at least 0")


@dataclass(slots=True)
class McmcTarget:
    """Somebody who is followed.

    Attributes:
        colors: `(2, 64)` of the upper and the lower half.
        aspect: width over height.
        states: `(P, 5)`, the samples: middle, height, step, in pixels.
        box: `(4,)`, the mean.
    """

    colors: Floats
    aspect: float
    states: Floats
    box: Floats


class McmcFilter:
    """Everybody jointly: who is near somebody else is pushed away from them."""

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

    def predict(self, image: Image | None, objects: Sequence[McmcTarget]) -> Floats:
        """Run the Markov chain: `(N, 4)`, NaN for targets whose colors are not found."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None or not objects:
            return boxes
        field, before = self._colors.get(image), np.stack([item.states for item in objects], axis=1)
        samples, distances = self._chain(field, objects, before)
        for row, item in enumerate(objects):
            item.states = samples[:, row]
            item.box = particle_boxes(item.states.mean(axis=0), item.aspect)
            if float(distances[:, row].mean()) <= _LOST:
                boxes[row] = item.box
        return boxes

    def update(self, known: McmcTarget, box: Floats) -> Floats:  # noqa: ARG002 — the colors alone say where
        """Return the target's own box: a detection does not move it."""
        return known.box

    def _chain(
        self, field: ColorIntegralImage, objects: Sequence[McmcTarget], before: Floats
    ) -> tuple[Floats, Floats]:
        """Run the chain; return its samples `(P, N, 5)` and color distances `(P, N)`."""
        count, plan, rng = len(objects), self._settings, self._rng
        steps = (plan.burn_in + plan.thinning * plan.samples) * count
        who = rng.integers(count, size=steps)
        # A proposal does not depend on where the chain is: all of them are drawn, and compared, at once.
        proposed = propagate(rng, before[rng.integers(len(before), size=steps), who])
        aspects = np.array([item.aspect for item in objects])
        boxes = particle_boxes(proposed, aspects[who])
        far = np.empty(steps)
        for row, item in enumerate(objects):
            mine = who == row
            far[mine] = color_distance(field, boxes[mine], item.colors)
        luck = np.log(rng.random(steps))
        now = propagate(rng, before[rng.integers(len(before))])
        places = particle_boxes(now, aspects)
        unlike_now = np.array(
            [float(color_distance(field, places[n], it.colors)) for n, it in enumerate(objects)]
        )
        kept, distances = np.empty((plan.samples, count, now.shape[1])), np.empty((plan.samples, count))
        for step in range(steps):
            n = who[step]
            gain = _LAMBDA * (unlike_now[n] - far[step])
            if count > 1:
                others = np.delete(places, n, axis=0)
                gain += _APART * float((iou(places[n], others) - iou(boxes[step], others)).sum())
            if luck[step] < gain:
                now[n], places[n], unlike_now[n] = proposed[step], boxes[step], far[step]
            place, rest = divmod(step + 1 - plan.burn_in * count, plan.thinning * count)
            if place >= 1 and not rest:
                kept[place - 1], distances[place - 1] = now, unlike_now
        return kept, distances
