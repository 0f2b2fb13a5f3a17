"""One particle filter for each object, by its colours (Pérez et al., ECCV 2002; Nummiaro et al. 2003).

A particle is a box: its middle, its height and the step that it took. It goes on as it went, with noise that
grows with its height, and weighs `exp(-λ d²)`, d being the Bhattacharyya distance of the colours in its upper
and lower halves from those that the object began with. Particles are drawn anew by their weights when
fewer than half of them count. Filters know nothing of each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.color_histograms import ColourFields, halves, unlike
from tracking.baselines.resampling import drawn_anew
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image

_LAMBDA = 20.0
_STEP, _GROW = 0.04, 0.01
"""Noise of a step and of the height, in heights."""
_GOES_ON = 0.8
"""Of a step, what the next one keeps."""
_LOST = 0.5
"""Mean squared distance above which nobody of these colours is among the particles."""


@dataclass(frozen=True, slots=True)
class ParticleSettings:
    """How many, and drawn by what.

    Raises:
        ValueError: there is none.
    """

    particles: int = 150  # of each object
    seed: int = 1  # of all noise

    def __post_init__(self) -> None:
        if self.particles < 1:
            raise ValueError(f"particles must be at least 1, not {self.particles}")


@dataclass(slots=True)
class Swarm:
    """Somebody who is followed.

    Attributes:
        colours: `(2, 64)` of the upper and the lower half.
        aspect: width over height.
        states: `(P, 5)`: middle, height, step, in pixels.
        weights: `(P,)`, which sum to 1.
        box: `(4,)`, the mean.
    """

    colours: Floats
    aspect: float
    states: Floats
    weights: Floats
    box: Floats


class ParticleFilters:
    """Independent filters, the basic tracker of the survey."""

    name = "particle"
    sees = True

    def __init__(self, settings: ParticleSettings | None = None) -> None:
        self._settings = settings or ParticleSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._colours = ColourFields()

    def begin(self, image: Image, box: Floats) -> Swarm:
        """Take somebody's colours, and put all particles at them."""
        count, (start, aspect) = self._settings.particles, standing(box)
        colours = self._colours.of(image).histograms(halves(box))
        return Swarm(colours, aspect, np.tile(start, (count, 1)), np.full(count, 1 / count), box.copy())

    def move(self, image: Image | None, objects: Sequence[Swarm]) -> Floats:
        """Let all particles go on and weigh them: `(N, 4)`, NaN where none is like its object."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        for row, item in enumerate(objects):
            self._go_on(item)
            distance = unlike(self._colours.of(image), particle_boxes(item.states, item.aspect), item.colours)
            item.weights = weighed(item.weights, distance, _LAMBDA)
            item.box = particle_boxes(item.weights @ item.states, item.aspect)
            if float(item.weights @ distance) <= _LOST:
                boxes[row] = item.box
        return boxes

    def found(self, known: Swarm, box: Floats) -> Floats:  # noqa: ARG002 — the colours alone say where
        """Give where somebody is: detections move nobody."""
        return known.box

    def _go_on(self, item: Swarm) -> None:
        """Draw anew where few particles count, and move all of them."""
        states, item.weights = drawn_anew(self._rng, item.states, item.weights)
        item.states = stepped(self._rng, states)


def standing(box: Floats) -> tuple[Floats, float]:
    """Give the state `(5,)` of somebody in a box `(4,)` who stands, and width over height."""
    tall = max(box[3] - box[1], 1.0)
    state = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, tall, 0.0, 0.0])
    return state, (box[2] - box[0]) / tall


def weighed(weights: Floats, distance: Floats, sharpness: float) -> Floats:
    """Weigh particles `(P,)` anew by how unlike they are, `(P,)`; the weights sum to 1."""
    # Relative to the nearest: what all of them lack, a shadow or a passer-by, is no weight.
    anew = weights * np.exp(-sharpness * (distance - distance.min()))
    return np.asarray(anew / anew.sum())


def stepped(rng: np.random.Generator, states: Floats) -> Floats:
    """Move particles `(..., 5)` as they went, with noise."""
    noise = rng.standard_normal((*states.shape[:-1], 3)) * states[..., 2:3]
    moved = states.copy()
    moved[..., 3:] = _GOES_ON * states[..., 3:] + _STEP * noise[..., :2]
    moved[..., :2] += moved[..., 3:]
    moved[..., 2] = np.maximum(states[..., 2] + _GROW * noise[..., 2], 1.0)
    return moved


def particle_boxes(states: Floats, aspect: float | Floats) -> Floats:
    """Give the boxes of particles `(..., 5)`, `(..., 4)`."""
    x, y, tall = states[..., 0], states[..., 1], states[..., 2]
    wide = tall * aspect
    return np.stack([x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2], axis=-1)
