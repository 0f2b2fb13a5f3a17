"""Gray histograms of boxes, sampled from the people and the background in them, without drawing pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper_experiments.scene import HEIGHT, WIDTH
from tracking.boxes import Floats

BINS = 64
"""As in the paper (IV.A.2)."""
_ACROSS, _DOWN = 9, 18
"""Sampled points of a box."""
_PIXELS = 500
"""Random samples of a box: fewer than its pixels, since neighboring ones are correlated."""
_BODY = 0.8
"""Width of a body as a share of its box; the rest is background."""
_TILES = 4
"""Tiles of the background on each side, each with its own histogram."""
_NOBODY = -1


@dataclass(frozen=True, slots=True, eq=False)
class Clothing:
    """The appearance of people and background.

    Attributes:
        halves: `(people, 2, BINS)` histograms of the upper and the lower body.
        tiles: `(_TILES, _TILES, BINS)` of the background.
    """

    halves: Floats
    tiles: Floats


def wardrobe(kits: tuple[int, ...], rng: np.random.Generator) -> Clothing:
    """Create the clothing: nearly equal for people of the same kit, different otherwise."""
    clothes = {kit: _clothes(place, len(set(kits)), rng) for place, kit in enumerate(dict.fromkeys(kits))}
    own = [clothes[kit] + rng.normal(0.0, 1.5, (2, 1)) for kit in kits]
    halves = np.array([[_bell(middles, rng) for middles in pair] for pair in own])
    tiles = np.array(
        [[_bell(rng.uniform(24, 44, 3), rng) for _ in range(_TILES)] for _ in range(_TILES)],
    )
    return Clothing(halves, tiles)


def _clothes(place: int, kits: int, rng: np.random.Generator) -> Floats:
    """Return the two gray levels of each half, `(2, 2)`, of a kit: kits differ most in the upper half."""
    level = 6.0 + (BINS - 12.0) * (place + 0.5) / kits
    shirt = level + np.array([0.0, rng.uniform(4, 8)])
    trousers = rng.uniform(4, BINS - 4) + np.array([0.0, rng.uniform(3, 6)])
    return np.stack([shirt, trousers])


def _bell(middles: Floats, rng: np.random.Generator) -> Floats:
    """Return a histogram with a bell around each level."""
    wide = rng.uniform(1.5, 3.0, (len(middles), 1))
    bells = np.exp(-0.5 * ((np.arange(BINS) - middles[:, None]) / wide) ** 2).sum(axis=0)
    return np.asarray(bells / bells.sum())


def owners(box: Floats, people: Floats) -> NDArray[np.int64]:
    """Return the person at each point of a box, `(_DOWN, _ACROSS)`; -1: none.

    `people` are boxes `(n, 4)`, NaN while absent; people with lower feet in the picture are nearer.
    """
    x = np.linspace(box[0], box[2], _ACROSS + 2)[1:-1]
    y = np.linspace(box[1], box[3], _DOWN + 2)[1:-1]
    shown = np.full((_DOWN, _ACROSS), _NOBODY)
    for k in np.argsort(np.where(np.isnan(people[:, 3]), -np.inf, people[:, 3]), kind="stable"):
        left, top, right, bottom = people[k]
        margin = (1.0 - _BODY) / 2.0 * (right - left)
        across = (x > left + margin) & (x < right - margin)
        shown[np.outer((y > top) & (y < bottom), across)] = k
    return shown


def visible(people: Floats) -> Floats:
    """Return the visible share of each person, `(n,)`; 0 while absent."""
    shares = np.zeros(len(people))
    for k, box in enumerate(people):
        if not np.isnan(box).any():
            alone = np.full_like(people, np.nan)
            alone[k] = box
            body = owners(box, alone) == k
            shares[k] = (owners(box, people)[body] == k).mean() if body.any() else 0.0
    return shares


def histogram(box: Floats, people: Floats, clothes: Clothing, rng: np.random.Generator) -> Floats:
    """Return the gray histogram of a box's content, `(BINS,)`, summing to 1, with noise."""
    shown = owners(box, people)
    y = np.linspace(box[1], box[3], _DOWN + 2)[1:-1]
    column, row = _tile((box[0] + box[2]) / 2, WIDTH), _tile((box[1] + box[3]) / 2, HEIGHT)
    mean = clothes.tiles[row, column] * (shown == _NOBODY).mean()
    for k in np.unique(shown[shown != _NOBODY]):
        lower = y > people[k, [1, 3]].mean()
        share = (shown == k).mean(axis=1)
        mean = mean + clothes.halves[k, 0] * share[~lower].sum() / _DOWN
        mean = mean + clothes.halves[k, 1] * share[lower].sum() / _DOWN
    return np.asarray(rng.multinomial(_PIXELS, mean / mean.sum()) / _PIXELS)


def _tile(at: float, size: int) -> int:
    return int(np.clip(at / size * _TILES, 0, _TILES - 1))
