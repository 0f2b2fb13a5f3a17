"""Two particle filters for each object that depend on each other: position and occlusion (Todor 2009, ch. 9).

A position is a window. How well it shows an object is the mean of `p(O|I)` over its pixels less the mean over
the ring around it, O and the background being mixtures of Gaussians over colour. An occlusion says what share
of somebody others hide. A window and an occlusion together are worth `S = Σ q_k S_k`: who is half hidden
looks half like who hides them. Each particle of one filter is weighed by `exp(λ S - μ hidden)`, averaged over
the particles of the other by their weights (the thesis draws one of them). The second term draws everybody
back to where they are not hidden; who is hidden is looked for further around, as their place is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from tracking.baselines.center_surround import RING, WindowSums, ringed
from tracking.baselines.color_mixture import MIDDLES, codes, fitted, posterior
from tracking.baselines.occluder_particles import Shares
from tracking.baselines.part_histograms import cores
from tracking.baselines.particle_filter import particle_boxes, standing, stepped
from tracking.baselines.resampling import drawn_anew
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image, Plane


@dataclass(frozen=True, slots=True)
class CueSettings:
    """The filters.

    Raises:
        ValueError: a number makes no sense.
    """

    particles: int = 100  # of each filter
    parts: int = 3  # Gaussians of somebody
    parts_behind: int = 6  # Gaussians of the background
    sharpness: float = 20.0  # λ
    reluctance: float = 8.0  # μ: against being hidden
    noise: float = 0.1  # of a share, from picture to picture
    jumps: float = 0.1  # share of its particles that is seen again, and share that is hidden, at once
    search: float = 0.1  # noise of a place for each share that is hidden, in heights
    lost: float = 0.05  # S below which nobody of these colours is there
    refresh: int = 250  # pictures after which the background is fitted again
    seed: int = 1  # of all noise

    def __post_init__(self) -> None:
        if min(self.particles, self.parts, self.parts_behind, self.refresh) < 1:
            raise ValueError("particles, parts, parts_behind and refresh must be at least 1")
        if not 0.0 <= self.jumps <= 0.5:  # noqa: PLR2004 — both shares together are all
            raise ValueError(f"jumps is a share between 0 and 0.5, not {self.jumps}")
        if self.sharpness <= 0.0 or min(self.reluctance, self.noise, self.search) < 0.0:
            raise ValueError("sharpness must be above 0, reluctance, noise and search at least 0")


@dataclass(slots=True)
class Target:
    """Somebody who is followed.

    Attributes:
        number: nobody else has it.
        likely: `(COLOURS,)`, p(I|O).
        mine: `(COLOURS,)`, p(O|I).
        aspect: width over height.
        states: `(P, 5)`, the positions: middle, height, step, in pixels.
        weights: `(P,)`, of the positions, which sum to 1.
        shares: the occlusions.
        box: `(4,)`, the mean.
    """

    number: int
    likely: Floats
    mine: Plane
    aspect: float
    states: Floats
    weights: Floats
    shares: Shares
    box: Floats


class OcclusionCues:
    """Positions and occlusions, each weighed by the other."""

    name = "occlusion-cues"
    sees = True

    def __init__(self, settings: CueSettings | None = None) -> None:
        self._settings = settings or CueSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._numbers = count(1)
        self._behind: Floats | None = None
        """`(COLOURS,)`, p(I|B)."""
        self._age = 0

    def begin(self, image: Image, box: Floats) -> Target:
        """Fit somebody's mixture to the middle of their box, and put all particles there."""
        plan, (start, aspect) = self._settings, standing(box)
        if self._behind is None:
            self._learn_background(image, [box])
        likely = fitted(_inside(image, cores(box)), plan.parts).densities(MIDDLES)
        states, weights = np.tile(start, (plan.particles, 1)), np.full(plan.particles, 1.0 / plan.particles)
        shares = Shares.none(plan.particles)
        return Target(
            next(self._numbers), likely, self._posterior(likely), aspect, states, weights, shares, box.copy()
        )

    def move(self, image: Image | None, objects: Sequence[Target]) -> Floats:
        """Let both filters of everybody go on: `(N, 4)`, NaN where nobody of an object's colours is."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        self._age += 1
        if objects and self._age > self._settings.refresh:
            self._learn_background(image, [item.box for item in objects])
            for item in objects:
                item.mine = self._posterior(item.likely)
        seen = [self._go_on(image, item, objects) for item in objects]
        for row, (item, worth) in enumerate(zip(objects, seen, strict=True)):
            item.box = particle_boxes(item.weights @ item.states, item.aspect)
            if worth >= self._settings.lost:
                boxes[row] = item.box
        return boxes

    def found(self, known: Target, box: Floats) -> Floats:  # noqa: ARG002 — the colours alone say where
        """Give where somebody is: detections move nobody."""
        return known.box

    def _learn_background(self, image: Image, boxes: Sequence[Floats]) -> None:
        """Fit the background's mixture to the picture outside everybody's boxes."""
        free = np.ones(image.shape[:2], dtype=bool)
        for box in boxes:
            left, top, right, bottom = np.maximum(np.rint(ringed(box)), 0).astype(int).tolist()
            free[top:bottom, left:right] = False
        pixels = image[free] if free.any() else image.reshape(-1, 3)
        self._behind, self._age = fitted(pixels, self._settings.parts_behind).densities(MIDDLES), 0

    def _posterior(self, likely: Floats) -> Plane:
        return posterior(likely, likely if self._behind is None else self._behind, RING)

    def _go_on(self, image: Image, item: Target, objects: Sequence[Target]) -> float:
        """Let one object's two filters go on, and weigh them; how well it is seen, S."""
        plan = self._settings
        states, item.weights = drawn_anew(self._rng, item.states, item.weights)
        item.states = stepped(self._rng, states)
        if item.shares.who:
            spread = plan.search * float(item.shares.weights @ item.shares.hidden) * item.states[:, 2:3]
            item.states[:, :2] += spread * self._rng.standard_normal((plan.particles, 2))
        windows = particle_boxes(item.states, item.aspect)
        wide = ringed(windows)
        area = np.concatenate([wide[:, :2].min(axis=0), wide[:, 2:].max(axis=0)])
        near = [it for it in objects if it is not item and _touch(it.box, area)]
        item.shares.go_on(self._rng, [it.number for it in near], plan.noise, plan.jumps)
        worths = _worths(image, area, windows, [item, *near])
        pairs = worths @ item.shares.all.T
        good = np.exp(plan.sharpness * (pairs - pairs.max()) - plan.reluctance * item.shares.hidden)
        before = item.weights, item.shares.weights
        item.weights = _normal(before[0] * (good @ before[1]))
        item.shares.weights = _normal(before[1] * (before[0] @ good))
        return float(item.weights @ pairs @ item.shares.weights)


def _inside(image: Image, box: Floats) -> Image:
    """Give the pixels `(N, 3)` in a box `(4,)`; the nearest where it is beside the picture."""
    high, wide = image.shape[:2]
    left, top = np.clip(np.rint(box[:2]), 0, [wide - 1, high - 1]).astype(int).tolist()
    right, bottom = np.clip(np.rint(box[2:]), [left + 1, top + 1], [wide, high]).astype(int).tolist()
    return np.ascontiguousarray(image[top:bottom, left:right]).reshape(-1, 3)


def _touch(box: Floats, area: Floats) -> bool:
    return bool((box[:2] < area[2:]).all() and (area[:2] < box[2:]).all())


def _worths(image: Image, area: Floats, windows: Floats, objects: Sequence[Target]) -> Floats:
    """Say how well windows `(P, 4)` show each object: `(P, N)`."""
    high, wide = image.shape[:2]
    left, top = np.clip(np.floor(area[:2]), 0, [wide, high]).astype(int).tolist()
    right, bottom = np.clip(np.ceil(area[2:]), [left, top], [wide, high]).astype(int).tolist()
    found = codes(image[top:bottom, left:right])
    likely = np.stack([it.mine[found] for it in objects], axis=-1)
    return WindowSums(likely, left, top).contrasts(windows)


def _normal(weights: Floats) -> Floats:
    return np.asarray(weights / weights.sum())
