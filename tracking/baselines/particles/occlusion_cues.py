"""Two coupled particle filters per target: position and occlusion (Todor 2009, ch. 9).

A position is a window. Its visibility is the mean of `p(O|I)` over its pixels minus the mean over the
surrounding ring, where O and the background are mixtures of Gaussians over color. An occlusion is the share
of the target that each other target hides. A window with an occlusion has the visibility `S = Σ q_k S_k`: a
half occluded target looks half like its occluder. Each particle of one filter is weighted by `exp(λ S - μ
hidden)`, averaged over the particles of the other filter by their weights (the thesis draws one of them).
The second term favors unoccluded positions. Occluded targets are searched in a wider area, since their
position is not observed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import cv2
import numpy as np

from tracking.baselines.integral_histograms import core_boxes
from tracking.baselines.particles.color_mixture import CODE_COLORS, color_codes, fit_mixture, posterior
from tracking.baselines.particles.occluder_particles import OccluderParticles
from tracking.baselines.particles.particle_filter import (
    initial_state,
    particle_boxes,
    propagate,
    resample_if_degenerate,
)
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image, Plane

RING_AREA_RATIO = 0.5
"""Area of the ring over that of the window."""


class CenterSurroundIntegral:
    """Integral image of several maps: center-surround contrast in constant time (Viola, Jones 2001)."""

    def __init__(self, values: Plane, left: float, top: float) -> None:
        """Integrate N maps `(H, W, N)`, whose first pixel is at `left`, `top` of the image."""
        height, width, maps = values.shape
        self._corner, self._limits = np.array([left, top] * 2), np.array([width, height, width, height])
        self._sums = np.zeros((height + 1, width + 1, maps))
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
        clipped = np.clip(np.rint(windows) - self._corner, 0, self._limits).astype(np.int64)
        left, top, right, bottom = np.moveaxis(clipped, -1, 0)
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
    """Settings of the particle filters and the color mixtures.

    Raises:
        ValueError: a setting is out of range.
    """

    particles: int = 100  # per filter
    components: int = 3  # Gaussians of a target's colors
    background_components: int = 6  # Gaussians of the background
    sharpness: float = 20.0  # λ
    occlusion_penalty: float = 8.0  # μ
    occlusion_noise: float = 0.1  # standard deviation of a hidden share's change per image
    jump_share: float = 0.1  # share of particles that become visible, and share that become hidden, per image
    occluded_search_noise: float = 0.1  # position noise of a fully hidden target, in heights
    min_visibility: float = 0.05  # S below which a target counts as lost
    background_refresh_frames: int = 250  # images after which the background is fitted again
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if (
            min(self.particles, self.components, self.background_components, self.background_refresh_frames)
            < 1
        ):
            raise ValueError("numbers of particles, components and frames must be at least 1")
        if not 0.0 <= self.jump_share <= 0.5:  # noqa: PLR2004 — the two shares sum to at most 1
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
        id: unique number.
        color_likelihood: `(COLORS,)`, p(I|O).
        color_posterior: `(COLORS,)`, p(O|I).
        aspect: width over height.
        states: `(P, 5)`, the position particles: center, height and velocity, in pixels.
        weights: `(P,)`, of the position particles, which sum to 1.
        occluders: the occlusion particles.
        box: `(4,)`, the mean box.
    """

    id: int
    color_likelihood: Floats
    color_posterior: Plane
    aspect: float
    states: Floats
    weights: Floats
    occluders: OccluderParticles
    box: Floats


class OcclusionCueTracker:
    """Coupled particle filters of position and occlusion."""

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
        """Create a target: fit its color mixture to its box's core, and put all particles at the box."""
        settings, (start, aspect) = self._settings, initial_state(box)
        if self._background is None:
            self._learn_background(image, [box])
        likelihood = fit_mixture(_pixels_inside(image, core_boxes(box)), settings.components).densities(
            CODE_COLORS
        )
        states, weights = (
            np.tile(start, (settings.particles, 1)),
            np.full(settings.particles, 1.0 / settings.particles),
        )
        occluders = OccluderParticles.unoccluded(settings.particles)
        return OcclusionCueTarget(
            next(self._numbers),
            likelihood,
            self._posterior(likelihood),
            aspect,
            states,
            weights,
            occluders,
            box.copy(),
        )

    def predict(self, image: Image | None, targets: Sequence[OcclusionCueTarget]) -> Floats:
        """Advance both filters of every target; return `(N, 4)`, NaN for lost targets."""
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        self._background_age += 1
        if targets and self._background_age > self._settings.background_refresh_frames:
            self._learn_background(image, [target.box for target in targets])
            for target in targets:
                target.color_posterior = self._posterior(target.color_likelihood)
        visibilities = [self._advance(image, target, targets) for target in targets]
        for row, (target, visibility) in enumerate(zip(targets, visibilities, strict=True)):
            target.box = particle_boxes(target.weights @ target.states, target.aspect)
            if visibility >= self._settings.min_visibility:
                boxes[row] = target.box
        return boxes

    def update(self, target: OcclusionCueTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box

    def _learn_background(self, image: Image, boxes: Sequence[Floats]) -> None:
        """Fit the background's mixture to the image outside the targets' boxes."""
        background = np.ones(image.shape[:2], dtype=bool)
        for box in boxes:
            left, top, right, bottom = np.maximum(np.rint(add_ring(box)), 0).astype(int).tolist()
            background[top:bottom, left:right] = False
        pixels = image[background] if background.any() else image.reshape(-1, 3)
        self._background, self._background_age = (
            fit_mixture(pixels, self._settings.background_components).densities(CODE_COLORS),
            0,
        )

    def _posterior(self, likelihood: Floats) -> Plane:
        background = likelihood if self._background is None else self._background
        return posterior(likelihood, background, RING_AREA_RATIO)

    def _advance(
        self, image: Image, target: OcclusionCueTarget, targets: Sequence[OcclusionCueTarget]
    ) -> float:
        """Advance and weigh one target's two filters; return its visibility S."""
        settings = self._settings
        states, target.weights = resample_if_degenerate(self._rng, target.states, target.weights)
        target.states = propagate(self._rng, states)
        if target.occluders.occluder_ids:
            spread = (
                settings.occluded_search_noise
                * float(target.occluders.weights @ target.occluders.hidden_shares)
                * target.states[:, 2:3]
            )
            target.states[:, :2] += spread * self._rng.standard_normal((settings.particles, 2))
        windows = particle_boxes(target.states, target.aspect)
        rings = add_ring(windows)
        area = np.concatenate([rings[:, :2].min(axis=0), rings[:, 2:].max(axis=0)])
        near = [other for other in targets if other is not target and _intersects(other.box, area)]
        target.occluders.resample_and_propagate(
            self._rng, [other.id for other in near], settings.occlusion_noise, settings.jump_share
        )
        contrasts = _contrasts(image, area, windows, [target, *near])
        visibilities = contrasts @ target.occluders.visible_and_hidden_shares.T
        likelihoods = np.exp(
            settings.sharpness * (visibilities - visibilities.max())
            - settings.occlusion_penalty * target.occluders.hidden_shares
        )
        before = target.weights, target.occluders.weights
        target.weights = _normalized(before[0] * (likelihoods @ before[1]))
        target.occluders.weights = _normalized(before[1] * (before[0] @ likelihoods))
        return float(target.weights @ visibilities @ target.occluders.weights)


def _pixels_inside(image: Image, box: Floats) -> Image:
    """Return the pixels `(N, 3)` of a box `(4,)`; the nearest pixel for a box outside the image."""
    height, width = image.shape[:2]
    left, top = np.clip(np.rint(box[:2]), 0, [width - 1, height - 1]).astype(int).tolist()
    right, bottom = np.clip(np.rint(box[2:]), [left + 1, top + 1], [width, height]).astype(int).tolist()
    return np.ascontiguousarray(image[top:bottom, left:right]).reshape(-1, 3)


def _intersects(box: Floats, area: Floats) -> bool:
    return bool((box[:2] < area[2:]).all() and (area[:2] < box[2:]).all())


def _contrasts(image: Image, area: Floats, windows: Floats, targets: Sequence[OcclusionCueTarget]) -> Floats:
    """Compute the center-surround contrast of each object in windows `(P, 4)`: `(P, N)`."""
    height, width = image.shape[:2]
    left, top = np.clip(np.floor(area[:2]), 0, [width, height]).astype(int).tolist()
    right, bottom = np.clip(np.ceil(area[2:]), [left, top], [width, height]).astype(int).tolist()
    codes = color_codes(image[top:bottom, left:right])
    posteriors = np.stack([target.color_posterior[codes] for target in targets], axis=-1)
    return CenterSurroundIntegral(posteriors, left, top).contrast(windows)


def _normalized(weights: Floats) -> Floats:
    return np.asarray(weights / weights.sum())
