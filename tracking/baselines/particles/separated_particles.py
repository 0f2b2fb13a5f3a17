"""Particle filters with an overlap factor between similar targets (Todor 2009, section 8.3).

A particle has the weight `exp(-λ Σ D²)`, summed over the parts of its box's core and the three color
channels. D² is one minus the Bhattacharyya coefficient of a part's histogram and its reference from the
first box.

A particle's weight is also multiplied by the square of its overlap factor: the share of its target's
particles among all particles in its cell. This keeps two similar targets from converging to the same person
("kidnapping" of independent filters). A target that is less similar to its reference than in its first images
is occluded; the overlap factor is then not applied, since it would push the target to the next similar
person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tracking.baselines.integral_histograms import (
    ChannelIntegralImage,
    bhattacharyya_coefficient,
    core_boxes,
    split_boxes,
)
from tracking.baselines.particles.particle_filter import (
    ParticleTarget,
    initial_state,
    particle_boxes,
    propagate,
    resample_if_degenerate,
    reweight,
)
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_MAX_DISTANCE = 0.5
"""Mean D² above which the target counts as lost."""


@dataclass(frozen=True, slots=True)
class SeparatedParticleSettings:
    """Settings of the particle filters.

    Raises:
        ValueError: a setting is out of range.
    """

    particles: int = 100  # per target
    rows: int = 4  # of parts in a box
    columns: int = 2
    sharpness: float = 8.0  # λ, for a sum over parts and channels
    cell_pixels: int = 4  # R: side of the cells in which particles overlap
    overlap_power: float = 2.0  # exponent of the overlap factor; 0: independent filters
    reference_frames: int = 20  # images in which a target's similarity to its reference is learned
    min_relative_similarity: float = 0.9  # share of that similarity below which a target is occluded
    seed: int = 1  # of the random numbers

    def __post_init__(self) -> None:
        if min(self.particles, self.rows, self.columns, self.cell_pixels, self.reference_frames) < 1:
            raise ValueError("particles, rows, columns, cell_pixels and reference_frames must be at least 1")
        if self.sharpness <= 0.0 or self.overlap_power < 0.0:
            raise ValueError("sharpness must be above 0, overlap_power at least 0")


@dataclass(slots=True)
class SeparatedTarget(ParticleTarget):
    """State of one target, whose colors are part histograms `(parts, 3, 8)`.

    Attributes:
        reference_similarities: similarities to the reference in the first images.
    """

    reference_similarities: list[float] = field(default_factory=list)


class SeparatedParticles:
    """One particle filter per target, kept apart from those of similar targets."""

    name = "separated-particles"
    uses_image = True

    def __init__(self, settings: SeparatedParticleSettings | None = None) -> None:
        self._settings = settings or SeparatedParticleSettings()
        self._rng = np.random.default_rng(self._settings.seed)

    def initialize(self, image: Image, box: Floats) -> SeparatedTarget:
        """Create a target from the part histograms of its box, with all particles at the box."""
        count, (start, aspect) = self._settings.particles, initial_state(box)
        colors = ChannelIntegralImage(image, box).histograms(self._parts(box))
        return SeparatedTarget(
            colors, aspect, np.tile(start, (count, 1)), np.full(count, 1.0 / count), box.copy()
        )

    def predict(self, image: Image | None, targets: Sequence[SeparatedTarget]) -> Floats:
        """Propagate, weigh and separate the particles; return `(N, 4)`, NaN for lost targets."""
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        weighed = [self._weigh(image, target) for target in targets]
        factors = overlap_factors([target.states[:, :2] for target in targets], self._settings.cell_pixels)
        for row, (target, (integral, distances), factor) in enumerate(
            zip(targets, weighed, factors, strict=True)
        ):
            if not self._is_occluded(integral, target):
                weights = target.weights * factor**self._settings.overlap_power
                target.weights = weights / weights.sum()
            target.box = particle_boxes(target.weights @ target.states, target.aspect)
            if float(target.weights @ distances) <= _MAX_DISTANCE:
                boxes[row] = target.box
        return boxes

    def update(self, target: SeparatedTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box

    def _parts(self, boxes: Floats) -> Floats:
        return split_boxes(core_boxes(boxes), self._settings.rows, self._settings.columns)

    def _weigh(self, image: Image, target: SeparatedTarget) -> tuple[ChannelIntegralImage, Floats]:
        """Propagate and weigh a target's particles; return the region's integral image and mean D² `(P,)`."""
        states, target.weights = resample_if_degenerate(self._rng, target.states, target.weights)
        target.states = propagate(self._rng, states)
        boxes = particle_boxes(target.states, target.aspect)
        region = np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])
        integral = ChannelIntegralImage(image, region)
        distances = 1.0 - bhattacharyya_coefficient(integral.histograms(self._parts(boxes)), target.colors)
        total = distances.sum(axis=(-2, -1))
        target.weights = reweight(target.weights, total, self._settings.sharpness)
        return integral, distances.mean(axis=(-2, -1))

    def _is_occluded(self, integral: ChannelIntegralImage, target: SeparatedTarget) -> bool:
        """Return whether a target is less similar to its reference than in its first images."""
        box = particle_boxes(target.weights @ target.states, target.aspect)
        similarity = float(
            bhattacharyya_coefficient(integral.histograms(self._parts(box)), target.colors).mean()
        )
        if len(target.reference_similarities) < self._settings.reference_frames:
            target.reference_similarities.append(similarity)
            return False
        return similarity < self._settings.min_relative_similarity * float(
            np.mean(target.reference_similarities)
        )


def overlap_factors(centers: Sequence[Floats], cell_pixels: int) -> list[Floats]:
    """Compute the overlap factor of each target's particles.

    Args:
        centers: for each target `(P, 2)`, x and y of its particles in pixels.
        cell_pixels: side of a cell, R.

    Returns:
        For each target `(P,)`, in (0, 1]: 1 where no other target has particles.
    """
    if not centers:
        return []
    owner = np.repeat(np.arange(len(centers)), [len(points) for points in centers])
    cells = np.floor(np.concatenate(centers) / cell_pixels).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    counts = np.zeros((len(centers), int(cell.max(initial=-1)) + 1))
    np.add.at(counts, (owner, cell), 1.0)
    factors = counts[owner, cell] / counts.sum(axis=0)[cell]
    return [factors[owner == number] for number in range(len(centers))]
