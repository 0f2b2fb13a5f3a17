"""Particle filters kept apart (Todor 2009, section 8.3, which has the separation from its reference 49).

A particle weighs `exp(-λ Σ D²)`, summed over the parts of its box (the middle of it, where somebody is) and
the three colour channels, D² being one less the Bhattacharyya coefficient of a part's histogram and that of
the same part of the box that the object began with.

Where particles of several objects are, each weighs the square of its overlap factor as well, so that two
alike do not end on the same one of them: the kidnapping of independent filters. Somebody who is less like
themselves than they were at first is behind somebody dressed otherwise. Nothing then drives them away, or
they would flee to the next who is dressed like them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tracking.baselines.part_histograms import PartField, cores, likeness, parts_of
from tracking.baselines.particle_filter import Swarm, particle_boxes, standing, stepped, weighed
from tracking.baselines.particle_overlap import overlap_factors
from tracking.baselines.resampling import drawn_anew
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_LOST = 0.5
"""Mean D² above which nobody of these colours is among the particles."""


@dataclass(frozen=True, slots=True)
class SeparatedSettings:
    """The filters.

    Raises:
        ValueError: a number makes no sense.
    """

    particles: int = 100  # of each object
    rows: int = 4  # of parts of a box
    columns: int = 2
    sharpness: float = 8.0  # λ, of a sum over parts and channels
    reduced: int = 4  # R, pixels: particles nearer than this overlap
    power: float = 2.0  # of the overlap factor; 0: independent filters
    first: int = 20  # pictures in which somebody's own likeness is learned
    alike: float = 0.9  # of that likeness below which somebody is behind another
    seed: int = 1  # of all noise

    def __post_init__(self) -> None:
        if min(self.particles, self.rows, self.columns, self.reduced, self.first) < 1:
            raise ValueError("particles, rows, columns, reduced and first must be at least 1")
        if self.sharpness <= 0.0 or self.power < 0.0:
            raise ValueError("sharpness must be above 0, power at least 0")


@dataclass(slots=True)
class Apart(Swarm):
    """Somebody who is followed, whose colours are `(parts, 3, 8)`: each part's histograms.

    Attributes:
        likenesses: how like themselves they were in their first pictures.
    """

    likenesses: list[float] = field(default_factory=list)


class SeparatedParticles:
    """One filter for each; who is dressed alike keeps apart."""

    name = "separated-particles"
    sees = True

    def __init__(self, settings: SeparatedSettings | None = None) -> None:
        self._settings = settings or SeparatedSettings()
        self._rng = np.random.default_rng(self._settings.seed)

    def begin(self, image: Image, box: Floats) -> Apart:
        """Take the colours of somebody's parts, and put all particles at them."""
        count, (start, aspect) = self._settings.particles, standing(box)
        colours = PartField(image, box).histograms(self._parts(box))
        return Apart(colours, aspect, np.tile(start, (count, 1)), np.full(count, 1.0 / count), box.copy())

    def move(self, image: Image | None, objects: Sequence[Apart]) -> Floats:
        """Let all particles go on, weigh and separate them: `(N, 4)`, NaN where none is like its object."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        seen = [self._weigh(image, item) for item in objects]
        factors = overlap_factors([item.states[:, :2] for item in objects], self._settings.reduced)
        for row, (item, (places, unlike), factor) in enumerate(zip(objects, seen, factors, strict=True)):
            if not self._behind_another(places, item):
                weights = item.weights * factor**self._settings.power
                item.weights = weights / weights.sum()
            item.box = particle_boxes(item.weights @ item.states, item.aspect)
            if float(item.weights @ unlike) <= _LOST:
                boxes[row] = item.box
        return boxes

    def found(self, known: Apart, box: Floats) -> Floats:  # noqa: ARG002 — the colours alone say where
        """Give where somebody is: detections move nobody."""
        return known.box

    def _parts(self, boxes: Floats) -> Floats:
        return parts_of(cores(boxes), self._settings.rows, self._settings.columns)

    def _weigh(self, image: Image, item: Apart) -> tuple[PartField, Floats]:
        """Let one object's particles go on and weigh them alone: the colours there, and their D² `(P,)`."""
        states, item.weights = drawn_anew(self._rng, item.states, item.weights)
        item.states = stepped(self._rng, states)
        places = particle_boxes(item.states, item.aspect)
        around = np.concatenate([places[:, :2].min(axis=0), places[:, 2:].max(axis=0)])
        colours = PartField(image, around)
        distances = 1.0 - likeness(colours.histograms(self._parts(places)), item.colours)
        total = distances.sum(axis=(-2, -1))
        item.weights = weighed(item.weights, total, self._settings.sharpness)
        return colours, distances.mean(axis=(-2, -1))

    def _behind_another(self, colours: PartField, item: Apart) -> bool:
        """Whether somebody is less like themselves than at first; learn from their first pictures."""
        box = particle_boxes(item.weights @ item.states, item.aspect)
        alike = float(likeness(colours.histograms(self._parts(box)), item.colours).mean())
        if len(item.likenesses) < self._settings.first:
            item.likenesses.append(alike)
            return False
        return alike < self._settings.alike * float(np.mean(item.likenesses))
