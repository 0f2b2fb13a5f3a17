"""Two coupled particle filters per target: position and occlusion (Todor 2009, ch. 9).

A position is a window. Its visibility is the mean of `p(O|I)` over its pixels minus the mean over the
surrounding ring, where O and the background are mixtures of Gaussians over color. An occlusion is the share
of the target that each other target hides. A window with an occlusion has the visibility `S = Σ q_k S_k`: a
half hidden target looks half like its occluder. Each particle of one filter is weighted by `exp(λ S - μ
hidden)`, averaged over the particles of the other filter by their weights (the thesis draws one of them).
The second term favors unoccluded positions. Hidden targets are searched in a wider area, since their
position is not observed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import cv2
import numpy as np

from tracking.baselines.color_mixture import CODE_COLORS, color_codes, fit_mixture, posterior
from tracking.baselines.occluder_particles import OccluderParticles
from tracking.baselines.part_histograms import core_boxes
from tracking.baselines.particle_filter import (
    initial_state,
    particle_boxes,
    propagate,
    resample_if_degenerate,
)
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image, Plane

RING_AREA_RATIO = 0.5
"""Pixels of the ring for each of the window's."""


class CenterSurroundIntegral:
    """Several maps' sums, by an integral image: any window costs as much as any other (Viola, Jones 2001)."""

    def __init__(self, values: Plane, left: float, top: float) -> None:
        """Sum N maps `(H, W, N)` up, the first pixel of which is at `left`, `top` of the picture."""
        high, wide, maps = values.shape
        self._corner, self._limits = np.array([left, top] * 2), np.array([wide, high, wide, high])
        self._sums = np.zeros((high + 1, wide + 1, maps))
        if values.size:
            self._sums = cv2.integral(values, sdepth=cv2.CV_64F).reshape(self._sums.shape)

    def contrast(self, windows: Floats) -> Floats:
        """Return the mean inside windows `(..., 4)` minus the mean in their surrounding rings, `(..., N)`."""
        inside, pixels = self._sums_over(windows)
        around, all_pixels = self._sums_over(add_ring(windows))
        ring = (around - inside) / np.maximum(all_pixels - pixels, 1.0)
        return np.asarray(inside / np.maximum(pixels, 1.0) - ring)

    def _sums_over(self, windows: Floats) -> tuple[Floats, Floats]:
        """Return the sums over windows, `(..., N)`, and their pixel counts, `(..., 1)`."""
        whole = np.clip(np.rint(windows) - self._corner, 0, self._limits).astype(np.int64)
        left, top, right, bottom = np.moveaxis(whole, -1, 0)
        sums = self._sums
        totals = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        return totals, ((right - left) * (bottom - top)).astype(np.float64)[..., None]


def add_ring(windows: Floats) -> Floats:
    """Return windows `(..., 4)` enlarged by their surrounding rings."""
    sides = windows[..., 2:] - windows[..., :2]
    margin = sides * (np.sqrt(1.0 + RING_AREA_RATIO) - 1.0) / 2
    return np.concatenate([windows[..., :2] - margin, windows[..., 2:] + margin], axis=-1)


@dataclass(frozen=True, slots=True)
class OcclusionCueSettings:
    """The filters.

    Raises:
        ValueError: a setting is out of range.
    """

    particles: int = 100  # of each filter
    components: int = 3  # Gaussians of somebody
    background_components: int = 6  # Gaussians of the background
    sharpness: float = 20.0  # λ
    occlusion_penalty: float = 8.0  # μ: against being hidden
    occlusion_noise: float = 0.1  # of a share, from picture to picture
    jump_share: float = 0.1  # share of particles that become visible, and share that become hidden, per image
    occluded_search_noise: float = 0.1  # noise of a place for each share that is hidden, in heights
    min_visibility: float = 0.05  # S below which nobody of these colors is there
    background_refresh_frames: int = 250  # pictures after which the background is fitted again
    seed: int = 1  # of all noise

    def __post_init__(self) -> None:
        if (
            min(self.particles, self.components, self.background_components, self.background_refresh_frames)
            < 1
        ):
            raise ValueError("numbers of particles, components and frames must be at least 1")
        if not 0.0 <= self.jump_share <= 0.5:  # noqa: PLR2004 — both shares together are all
            raise ValueError(f"jump_share is a share between 0 and 0.5, not {self.jump_share}")
        if (
            self.sharpness <= 0.0
            or min(self.occlusion_penalty, self.occlusion_noise, self.occluded_search_noise) < 0.0
        ):
            raise ValueError("sharpness must be above 0; occlusion_penalty and noise must be at least 0")


@dataclass(slots=True)
class OcclusionCueTarget:
    """State of one target.

    Attributes:
        id: nobody else has it.
        color_likelihood: `(COLORS,)`, p(I|O).
        color_posterior: `(COLORS,)`, p(O|I).
        aspect: width over height.
        states: `(P, 5)`, the positions: middle, height, step, in pixels.
        weights: `(P,)`, of the positions, which sum to 1.
        occluders: the occlusions.
        box: `(4,)`, the mean.
    """

    id: int
    color_likelihood: Floats
    color_posterior: Plane
    aspect: float
    states: Floats
    weights: Floats
    occluders: OccluderParticles
    box: Floats


class OcclusionCues:
    """Positions and occlusions, each weighed by the other."""

    name = "occlusion-cues"
    uses_image = True

    def __init__(self, settings: OcclusionCueSettings | None = None) -> None:
        self._settings = settings or OcclusionCueSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._numbers = count(1)
        self._background: Floats | None = None
        """`(COLORS,)`, p(I|B)."""
        self._background_age = 0

    def initialize(self, image: Image, box: Floats) -> OcclusionCueTarget:
        """Create a target: fit its color mixture to the core of its box and put all particles there."""
        plan, (start, aspect) = self._settings, initial_state(box)
        if self._background is None:
            self._learn_background(image, [box])
        likely = fit_mixture(_pixels_inside(image, core_boxes(box)), plan.components).densities(CODE_COLORS)
        states, weights = np.tile(start, (plan.particles, 1)), np.full(plan.particles, 1.0 / plan.particles)
        shares = OccluderParticles.unoccluded(plan.particles)
        return OcclusionCueTarget(
            next(self._numbers), likely, self._posterior(likely), aspect, states, weights, shares, box.copy()
        )

    def predict(self, image: Image | None, objects: Sequence[OcclusionCueTarget]) -> Floats:
        """Advance both filters of every target: `(N, 4)`, NaN for targets whose colors are not found."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        self._background_age += 1
        if objects and self._background_age > self._settings.background_refresh_frames:
            self._learn_background(image, [item.box for item in objects])
            for item in objects:
                item.color_posterior = self._posterior(item.color_likelihood)
        visibilities = [self._advance(image, item, objects) for item in objects]
        for row, (item, visibility) in enumerate(zip(objects, visibilities, strict=True)):
            item.box = particle_boxes(item.weights @ item.states, item.aspect)
            if visibility >= self._settings.min_visibility:
                boxes[row] = item.box
        return boxes

    def update(self, known: OcclusionCueTarget, box: Floats) -> Floats:  # noqa: ARG002 — the image alone decides
        """Return the target's own box: a detection does not move it."""
        return known.box

    def _learn_background(self, image: Image, boxes: Sequence[Floats]) -> None:
        """Fit the background's mixture to the picture outside everybody's boxes."""
        free = np.ones(image.shape[:2], dtype=bool)
        for box in boxes:
            left, top, right, bottom = np.maximum(np.rint(add_ring(box)), 0).astype(int).tolist()
            free[top:bottom, left:right] = False
        pixels = image[free] if free.any() else image.reshape(-1, 3)
        self._background, self._background_age = (
            fit_mixture(pixels, self._settings.background_components).densities(CODE_COLORS),
            0,
        )

    def _posterior(self, likely: Floats) -> Plane:
        return posterior(likely, likely if self._background is None else self._background, RING_AREA_RATIO)

    def _advance(
        self, image: Image, item: OcclusionCueTarget, objects: Sequence[OcclusionCueTarget]
    ) -> float:
        """Advance and weigh one target's two filters; return how visible it is, S."""
        plan = self._settings
        states, item.weights = resample_if_degenerate(self._rng, item.states, item.weights)
        item.states = propagate(self._rng, states)
        if item.occluders.occluder_ids:
            spread = (
                plan.occluded_search_noise
                * float(item.occluders.weights @ item.occluders.hidden_share)
                * item.states[:, 2:3]
            )
            item.states[:, :2] += spread * self._rng.standard_normal((plan.particles, 2))
        windows = particle_boxes(item.states, item.aspect)
        wide = add_ring(windows)
        area = np.concatenate([wide[:, :2].min(axis=0), wide[:, 2:].max(axis=0)])
        near = [it for it in objects if it is not item and _intersects(it.box, area)]
        item.occluders.propagate(self._rng, [it.id for it in near], plan.occlusion_noise, plan.jump_share)
        worths = _contrasts(image, area, windows, [item, *near])
        pairs = worths @ item.occluders.visible_and_hidden_shares.T
        good = np.exp(
            plan.sharpness * (pairs - pairs.max()) - plan.occlusion_penalty * item.occluders.hidden_share
        )
        before = item.weights, item.occluders.weights
        item.weights = _normalized(before[0] * (good @ before[1]))
        item.occluders.weights = _normalized(before[1] * (before[0] @ good))
        return float(item.weights @ pairs @ item.occluders.weights)


def _pixels_inside(image: Image, box: Floats) -> Image:
    """Return the pixels `(N, 3)` of a box `(4,)`; the nearest pixel for a box outside the image."""
    high, wide = image.shape[:2]
    left, top = np.clip(np.rint(box[:2]), 0, [wide - 1, high - 1]).astype(int).tolist()
    right, bottom = np.clip(np.rint(box[2:]), [left + 1, top + 1], [wide, high]).astype(int).tolist()
    return np.ascontiguousarray(image[top:bottom, left:right]).reshape(-1, 3)


def _intersects(box: Floats, area: Floats) -> bool:
    return bool((box[:2] < area[2:]).all() and (area[:2] < box[2:]).all())


def _contrasts(image: Image, area: Floats, windows: Floats, objects: Sequence[OcclusionCueTarget]) -> Floats:
    """Compute the center-surround contrast of each object in windows `(P, 4)`: `(P, N)`."""
    high, wide = image.shape[:2]
    left, top = np.clip(np.floor(area[:2]), 0, [wide, high]).astype(int).tolist()
    right, bottom = np.clip(np.ceil(area[2:]), [left, top], [wide, high]).astype(int).tolist()
    found = color_codes(image[top:bottom, left:right])
    likely = np.stack([it.color_posterior[found] for it in objects], axis=-1)
    return CenterSurroundIntegral(likely, left, top).contrast(windows)


def _normalized(weights: Floats) -> Floats:
    return np.asarray(weights / weights.sum())
