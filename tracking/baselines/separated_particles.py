"""Particle filters with an overlap factor between similar targets (Todor 2009, section 8.3).

A particle has the weight `exp(-λ Σ D²)`, summed over the parts of its box's core and the three color
channels; D² is one minus the Bhattacharyya coefficient of a part's histogram and its reference from the
first box.

A particle's weight is also multiplied by the square of its overlap factor: the share of its target's own
particles among all particles in its cell. So two similar targets do not end on the same person
("kidnapping" of independent filters). A target that looks less like its reference than in its first images
is occluded; the overlap factor is then not applied, since it would push the target to the next similar
person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tracking.baselines.part_histograms import (
    PartHistograms,
    bhattacharyya_coefficient,
    core_boxes,
    split_boxes,
)
from tracking.baselines.particle_filter import (
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
"""Mean D² above which nobody of these colors is among the particles."""


@dataclass(frozen=True, slots=True)
class SeparatedParticleSettings:
    """The filters.

    Raises:
        ValueError: a setting is out of range.
    """

    particles: int = 100  # of each object
    rows: int = 4  # of parts of a box
    columns: int = 2
    sharpness: float = 8.0  # λ, of a sum over parts and channels
    cell_pixels: int = 4  # R, pixels: particles nearer than this overlap
    overlap_power: float = 2.0  # of the overlap factor; 0: independent filters
    reference_frames: int = 20  # pictures in which somebody's own likeness is learned
    min_relative_similarity: float = 0.9  # of that likeness below which somebody is behind another
    seed: int = 1  # of all noise

    def __post_init__(self) -> None:
        if min(self.particles, self.rows, self.columns, self.cell_pixels, self.reference_frames) < 1:
            raise ValueError("particles, rows, columns, cell_pixels and reference_frames must be at least 1")
        if self.sharpness <= 0.0 or self.overlap_power < 0.0:
            raise ValueError("sharpness must be above 0, overlap_power at least 0")


@dataclass(slots=True)
class SeparatedTarget(ParticleTarget):
    """State of one target, whose colors are part histograms `(parts, 3, 8)`.

    Attributes:
        reference_similarities: how like themselves they were in their first pictures.
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
        """Create a target: take its part histograms and put all particles at its box."""
        count, (start, aspect) = self._settings.particles, initial_state(box)
        colors = PartHistograms(image, box).histograms(self._parts(box))
        return SeparatedTarget(
            colors, aspect, np.tile(start, (count, 1)), np.full(count, 1.0 / count), box.copy()
        )

    def predict(self, image: Image | None, objects: Sequence[SeparatedTarget]) -> Floats:
        """Propagate, weigh and separate the particles: `(N, 4)`, NaN where none matches its target."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        seen = [self._weigh(image, item) for item in objects]
        factors = overlap_factors([item.states[:, :2] for item in objects], self._settings.cell_pixels)
        for row, (item, (places, unlike), factor) in enumerate(zip(objects, seen, factors, strict=True)):
            if not self._is_occluded(places, item):
                weights = item.weights * factor**self._settings.overlap_power
                item.weights = weights / weights.sum()
            item.box = particle_boxes(item.weights @ item.states, item.aspect)
            if float(item.weights @ unlike) <= _MAX_DISTANCE:
                boxes[row] = item.box
        return boxes

    def update(self, known: SeparatedTarget, box: Floats) -> Floats:  # noqa: ARG002 — the image alone decides
        """Return the target's own box: a detection does not move it."""
        return known.box

    def _parts(self, boxes: Floats) -> Floats:
        return split_boxes(core_boxes(boxes), self._settings.rows, self._settings.columns)

    def _weigh(self, image: Image, item: SeparatedTarget) -> tuple[PartHistograms, Floats]:
        """Propagate and weigh one target's particles: the histograms there, and their D² `(P,)`."""
        states, item.weights = resample_if_degenerate(self._rng, item.states, item.weights)
        item.states = propagate(self._rng, states)
        places = particle_boxes(item.states, item.aspect)
        around = np.concatenate([places[:, :2].min(axis=0), places[:, 2:].max(axis=0)])
        colors = PartHistograms(image, around)
        distances = 1.0 - bhattacharyya_coefficient(colors.histograms(self._parts(places)), item.colors)
        total = distances.sum(axis=(-2, -1))
        item.weights = reweight(item.weights, total, self._settings.sharpness)
        return colors, distances.mean(axis=(-2, -1))

    def _is_occluded(self, colors: PartHistograms, item: SeparatedTarget) -> bool:
        """Return whether a target looks less like its reference than in its first images: it is occluded."""
        box = particle_boxes(item.weights @ item.states, item.aspect)
        alike = float(bhattacharyya_coefficient(colors.histograms(self._parts(box)), item.colors).mean())
        if len(item.reference_similarities) < self._settings.reference_frames:
            item.reference_similarities.append(alike)
            return False
        return alike < self._settings.min_relative_similarity * float(np.mean(item.reference_similarities))


def overlap_factors(middles: Sequence[Floats], reduced: int) -> list[Floats]:
    """Compute the overlap factor of each object's particles.

    Args:
        middles: of each object `(P, 2)`, x and y in pixels.
        reduced: pixels that a cell is wide and high, R.

    Returns:
        Of each object `(P,)`, in (0, 1]: 1 where nobody else has particles.
    """
    if not middles:
        return []
    owner = np.repeat(np.arange(len(middles)), [len(it) for it in middles])
    cells = np.floor(np.concatenate(middles) / reduced).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    counts = np.zeros((len(middles), int(cell.max(initial=-1)) + 1))
    np.add.at(counts, (owner, cell), 1.0)
    factors = counts[owner, cell] / counts.sum(axis=0)[cell]
    return [factors[owner == number] for number in range(len(middles))]
