"""A simulated school of identical fish without pictures: the detections of a foreground detector.

Nine fish of one length swim at random in a tank in front of the camera and avoid each other and the walls
(Todor 2009, section 8.1). Their boxes grow with nearness and get shorter where they swim to or from the
camera; far fish are pale. Half occluded fish are rarely detected, and boxes of partly occluded ones are
inexact.
"""

from __future__ import annotations

import numpy as np

from benchmarks.operator_assist.clips import Clip
from benchmarks.paper_experiments.scene import ObjectTruth
from tracking import Detections
from tracking.boxes import Floats

FPS = 30.0
_TANK = np.array([3.0, 1.6, 3.0])
"""Half of the tank's width, height and depth, fish lengths."""
_AWAY = 9.0
_FOCAL = 900.0
_MIDDLE = np.array([400.0, 300.0])
_SPEED = 0.035
"""Lengths per frame: one per second."""
_APART = 1.1
_BINS = 64
_GRID = 12


def simulate_school(seed: int, fish: int = 9, seconds: float = 20.0) -> Clip:
    """Simulate a clip; deterministic by seed."""
    rng = np.random.default_rng(seed)
    places, headings = _swim(fish, round(seconds * FPS), rng)
    boxes = _boxes(places, headings)
    shares = np.stack([_visible(boxes[:, t], places[:, t, 2]) for t in range(boxes.shape[1])], axis=1)
    detections = tuple(_found(boxes[:, t], shares[:, t], places[:, t, 2], rng) for t in range(boxes.shape[1]))
    return Clip(seed, FPS, detections, ObjectTruth(boxes, shares))


def _swim(fish: int, frames: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return the centers `(fish, frames, 3)` and unit headings of the same shape."""
    angle = 2 * np.pi * np.arange(fish) / fish
    here = np.stack([2.4 * np.cos(angle), 1.2 * np.sin(angle), np.zeros(fish)], axis=1)
    way = np.tile([0.0, 0.0, -0.3], (fish, 1)) + rng.normal(0.0, 0.2, (fish, 3))
    push = np.zeros((fish, 3))
    places, headings = np.empty((fish, frames, 3)), np.empty((fish, frames, 3))
    for t in range(frames):
        push = 0.95 * push + rng.normal(0.0, 0.012, (fish, 3)) * [1.0, 0.3, 1.0]
        gap = here[:, None] - here[None]
        far = np.linalg.norm(gap, axis=2) + 10.0 * np.eye(fish)
        away = (gap / far[..., None] * np.maximum(_APART - far, 0.0)[..., None]).sum(axis=1)
        wall = -np.sign(here) * np.maximum(np.abs(here) - _TANK + 0.6, 0.0)
        way = way + push + 0.25 * away + 0.08 * wall
        way *= 1.0 / np.linalg.norm(way, axis=1, keepdims=True)
        here = here + _SPEED * way
        places[:, t], headings[:, t] = here, way
    return places, headings


def _boxes(places: Floats, headings: Floats) -> Floats:
    """Return the boxes `(fish, frames, 4)`, pixels, of bodies one length long and a third high."""
    scale = _FOCAL / (_AWAY + places[..., 2])
    middle = _MIDDLE + places[..., :2] * scale[..., None]
    across = scale * (0.25 + 0.75 * np.hypot(headings[..., 0], 0.0))
    down = scale * (0.32 + 0.25 * np.abs(headings[..., 1]))
    half = np.stack([across, down], axis=-1) / 2.0
    return np.concatenate([middle - half, middle + half], axis=-1)


def _visible(boxes: Floats, depth: Floats) -> Floats:
    """Return the unoccluded share of each box `(n, 4)`, on a grid of points."""
    steps = (np.arange(_GRID) + 0.5) / _GRID
    shares = np.ones(len(boxes))
    for n, (left, top, right, bottom) in enumerate(boxes):
        across = left + steps * (right - left)
        down = top + steps * (bottom - top)
        hidden = np.zeros((_GRID, _GRID), dtype=bool)
        for other in np.flatnonzero(depth < depth[n]):
            x = (across >= boxes[other, 0]) & (across <= boxes[other, 2])
            y = (down >= boxes[other, 1]) & (down <= boxes[other, 3])
            hidden |= y[:, None] & x[None]
        shares[n] = 1.0 - hidden.mean()
    return shares


def _found(boxes: Floats, shares: Floats, depth: Floats, rng: np.random.Generator) -> Detections:
    """Return the detections of one frame, in random order."""
    clear = np.clip(1.0 - 0.18 * (depth + _TANK[2]), 0.0, 1.0)
    found, scores, looks = [], [], []
    for n in rng.permutation(len(boxes)):
        if shares[n] < 0.3 or rng.random() > shares[n] * (0.9 + 0.1 * clear[n]) + 0.02:
            continue
        tall = boxes[n, 3] - boxes[n, 1]
        found.append(boxes[n] + rng.normal(0.0, tall * (0.02 + 0.1 * (1.0 - shares[n])), 4))
        scores.append(float(np.clip(rng.uniform(0.7, 1.0) * (0.6 + 0.4 * clear[n]), 0.0, 1.0)))
        looks.append(_look(clear[n], rng))
    if not found:
        return Detections.empty(_BINS)
    return Detections(np.array(found), np.array(scores), np.array(looks))


def _look(clear: float, rng: np.random.Generator) -> Floats:
    """Return the gray histogram `(_BINS,)` of a fish: paler with distance, noisy by the light."""
    level = 0.75 * _BINS - 20.0 * clear + rng.normal(0.0, 0.7)
    counts = np.histogram(rng.normal(level, 4.0, 1500), bins=_BINS, range=(0, _BINS))[0] + 0.01
    return np.asarray(counts / counts.sum())
