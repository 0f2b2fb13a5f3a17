"""CONDENSATION: a particle filter of an outline on edges (Isard, Blake, IJCV 1998; Todor 2009, 5.2).

A particle moves and scales the target's outline, a B-spline that is fitted to the edges around its first box.
It is weighted by the edges on the outline's normals (`contour.py`): colors do not count, so that changes of
light do no harm, and edges of the background and of other people distract it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.particles.contour import BODY, Outline, contour_cost, edge_distances, find_edges
from tracking.baselines.particles.particle_filter import (
    initial_state,
    particle_boxes,
    propagate,
    resample_if_degenerate,
    reweight,
)
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_FIT_REACH = 0.12
"""How far from a standing person's outline its own edges are searched in the first image, in heights."""
_MAX_COST = 0.75
"""Mean cost of the outline, of at most 1, above which the target counts as lost."""


@dataclass(frozen=True, slots=True)
class ContourSettings:
    """Settings of the outline and the filter.

    Raises:
        ValueError: a setting is out of range.
    """

    particles: int = 150  # per target
    normals: int = 32  # M
    reach: float = 0.08  # μ: search along a normal on either side, in heights
    steps: int = 8  # positions searched on either side
    deviation: float = 0.014  # root of r: usual distance of an edge from the outline, in heights
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if min(self.particles, self.normals, self.steps) < 1:
            raise ValueError("particles, normals and steps must be at least 1")
        if self.reach <= 0.0 or self.deviation <= 0.0:
            raise ValueError("reach and deviation must be above 0")


@dataclass(slots=True)
class ContourTarget:
    """State of one target.

    Attributes:
        outline: its outline.
        aspect: width over height.
        states: `(P, 5)`: center, height and velocity, in pixels.
        weights: `(P,)`, which sum to 1.
        box: `(4,)`, the mean box.
    """

    outline: Outline
    aspect: float
    states: Floats
    weights: Floats
    box: Floats


class ContourParticles:
    """Independent particle filters of outlines."""

    name = "contour-particles"
    uses_image = True

    def __init__(self, settings: ContourSettings | None = None) -> None:
        self._settings = settings or ContourSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._last: tuple[Image, NDArray[np.bool_]] | None = None

    def initialize(self, image: Image, box: Floats) -> ContourTarget:
        """Create a target with an outline fitted to the edges around its box."""
        count, (start, aspect) = self._settings.particles, initial_state(box)
        body = Outline.of_body(aspect, self._settings.normals)
        found = edge_distances(
            self._edges(image), body, start[None, :2], start[2:3], _FIT_REACH, 2 * self._settings.steps
        )[0]
        outline = body.fitted(np.where(np.isfinite(found), found, 0.0), len(BODY))
        states = np.tile(start, (count, 1))
        return ContourTarget(outline, aspect, states, np.full(count, 1.0 / count), box.copy())

    def predict(self, image: Image | None, targets: Sequence[ContourTarget]) -> Floats:
        """Propagate and weigh the particles; return `(N, 4)`, NaN for lost targets.

        Without an image they are only propagated: outlines that fall behind find no edges again.
        """
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None:
            for target in targets:
                target.states = propagate(self._rng, target.states)
            return boxes
        edges, settings = self._edges(image), self._settings
        sharpness = settings.reach**2 / (2.0 * settings.deviation**2)
        for row, target in enumerate(targets):
            states, target.weights = resample_if_degenerate(self._rng, target.states, target.weights)
            target.states = propagate(self._rng, states)
            distances = edge_distances(
                edges,
                target.outline,
                target.states[:, :2],
                target.states[:, 2],
                settings.reach,
                settings.steps,
            )
            cost = contour_cost(distances, settings.reach)
            target.weights = reweight(target.weights, cost, sharpness)
            target.box = particle_boxes(target.weights @ target.states, target.aspect)
            if float(target.weights @ cost) <= _MAX_COST:
                boxes[row] = target.box
        return boxes

    def update(self, target: ContourTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box

    def _edges(self, image: Image) -> NDArray[np.bool_]:
        """Return the edges of an image; the last ones are cached."""
        if self._last is None or self._last[0] is not image:
            self._last = image, find_edges(image)
        return self._last[1]
