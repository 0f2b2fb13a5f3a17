"""One filter for all objects: MCMC with an interaction prior (Khan, Balch, Dellaert, ECCV 2004).

A sample is the joint state of all targets. In each image the Markov chain starts at a propagated sample of
the previous image. Then one target at a time, drawn at random, is proposed to move differently, which is
accepted with probability min(1, ratio) of `exp(-λ d²) Π exp(-g overlap)`: the color likelihood times the
pairwise prior against overlapping targets. Samples after the burn-in are kept for the next image.
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

_LAMBDA, _OVERLAP_WEIGHT = 20.0, 8.0
_MAX_DISTANCE = 0.5
"""Mean squared color distance above which a target counts as lost."""


@dataclass(frozen=True, slots=True)
class McmcSettings:
    """The chain.

    Raises:
        ValueError: a setting is out of range.
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
    """State of one target.

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
            if float(distances[:, row].mean()) <= _MAX_DISTANCE:
                boxes[row] = item.box
        return boxes

    def update(self, known: McmcTarget, box: Floats) -> Floats:  # noqa: ARG002 — the image alone decides
        """Return the target's own box: a detection does not move it."""
        return known.box

    def _chain(
        self, field: ColorIntegralImage, objects: Sequence[McmcTarget], before: Floats
    ) -> tuple[Floats, Floats]:
        """Run the chain; return its samples `(P, N, 5)` and color distances `(P, N)`."""
        count, plan, rng = len(objects), self._settings, self._rng
        steps = (plan.burn_in + plan.thinning * plan.samples) * count
        moving = rng.integers(count, size=steps)
        # A proposal does not depend on the chain's state: all are drawn and compared at once.
        proposed = propagate(rng, before[rng.integers(len(before), size=steps), moving])
        aspects = np.array([item.aspect for item in objects])
        boxes = particle_boxes(proposed, aspects[moving])
        far = np.empty(steps)
        for row, item in enumerate(objects):
            mine = moving == row
            far[mine] = color_distance(field, boxes[mine], item.colors)
        log_uniform = np.log(rng.random(steps))
        now = propagate(rng, before[rng.integers(len(before))])
        places = particle_boxes(now, aspects)
        unlike_now = np.array(
            [float(color_distance(field, places[n], it.colors)) for n, it in enumerate(objects)]
        )
        kept, distances = np.empty((plan.samples, count, now.shape[1])), np.empty((plan.samples, count))
        for step in range(steps):
            n = moving[step]
            gain = _LAMBDA * (unlike_now[n] - far[step])
            if count > 1:
                others = np.delete(places, n, axis=0)
                gain += _OVERLAP_WEIGHT * float((iou(places[n], others) - iou(boxes[step], others)).sum())
            if log_uniform[step] < gain:
                now[n], places[n], unlike_now[n] = proposed[step], boxes[step], far[step]
            place, rest = divmod(step + 1 - plan.burn_in * count, plan.thinning * count)
            if place >= 1 and not rest:
                kept[place - 1], distances[place - 1] = now, unlike_now
        return kept, distances
