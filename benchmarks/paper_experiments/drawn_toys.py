"""Two drawn toys that pass in front of each other, detected by template matching (paper IV.A.1).

The background has patches that resemble the toys; the toys turn a little, the light changes, and the nearer
toy alternates from meeting to meeting. Each has its own observations: about 80 local peaks of the match with
its picture in the first frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.paper_experiments.scene import HEIGHT, WIDTH, ExperimentScene, ObjectTruth
from tracking import Template
from tracking.boxes import Floats
from tracking.detectors import Image
from tracking.detectors.template import TemplateDetector, TemplateSettings

TOYS = 2
_TALL, _WIDE = 72, 56
"""Pixels of a toy."""
_SPOTS = 4
"""Spots of color on each side of a toy's texture."""
_SPOTS_BEHIND = 24
_ALIKE = 0.5
"""Share of the first toy's texture in the second's."""
_PATCHES = 14
"""Patches of the background that resemble a toy."""
_LIKE = 0.15
"""Share of a toy's own texture in such a patch."""
_TURN_DEGREES = 4.0
_LIGHT = 0.06
_APART = 0.01
"""Least distance of peaks, as a share of a toy's size: so there are nearly as many as in the paper."""
_NOISE = 4.0
"""Gray levels, standard deviation of a pixel."""
_MEETING = 55.0
"""Frames between two meetings."""
_SWING = 70.0
"""Pixels from the middle of the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Toys:
    """The textures and paths of the toys, and the background.

    Attributes:
        looks: `(TOYS, _TALL, _WIDE, 3)`.
        behind: `(HEIGHT, WIDTH, 3)`.
        middles: `(TOYS, T, 2)`, pixels.
    """

    looks: Floats
    behind: Floats
    middles: Floats


def toys(frames: int, rng: np.random.Generator) -> Toys:
    """Create two toys, their paths and a background."""
    looks = np.array([_texture(_TALL, _WIDE, _SPOTS, rng) for _ in range(TOYS)])
    looks[1:] = _ALIKE * looks[0] + (1.0 - _ALIKE) * looks[1:]
    behind = 0.5 * _texture(HEIGHT, WIDTH, _SPOTS_BEHIND, rng) + 60.0
    for _ in range(_PATCHES):
        left, top = rng.integers(0, WIDTH - _WIDE), rng.integers(0, HEIGHT - _TALL)
        own = looks[rng.integers(TOYS)]
        patch = _LIKE * own + (1.0 - _LIKE) * _texture(_TALL, _WIDE, _SPOTS, rng)
        place = behind[top : top + _TALL, left : left + _WIDE]
        place[_mask()] = patch[_mask()]
    return Toys(looks, behind, _ways(frames, rng))


def play_toys(frames: int, seed: int, peaks: int = 80) -> ExperimentScene:
    """Draw the toys and detect them; deterministic by seed."""
    rng = np.random.default_rng(seed)
    made = toys(frames, rng)
    shown = list(draw(made, rng))
    boxes = _boxes(made.middles)
    first = [_cut(shown[0][0], box) for box in boxes[:, 0]]
    detectors = [
        TemplateDetector(picture, TemplateSettings(max_peaks=peaks, peak_distance=_APART))
        for picture in first
    ]
    seen = tuple(tuple(one.detect(image) for image, _ in shown) for one in detectors)
    templates = tuple(
        Template(k + 1, one.histogram, box)
        for k, (one, box) in enumerate(zip(detectors, boxes[:, 0], strict=True))
    )
    return ExperimentScene(
        ObjectTruth(boxes, np.array([visible for _, visible in shown]).T), seen, templates, tuple(range(TOYS))
    )


def draw(made: Toys, rng: np.random.Generator) -> Iterator[tuple[Image, Floats]]:
    """Yield the drawn frames with the visible share of each toy, `(TOYS,)`."""
    phases = rng.uniform(0.0, 2.0 * np.pi, TOYS)
    for t in range(made.middles.shape[1]):
        canvas = made.behind.copy()
        covered = np.full((HEIGHT, WIDTH), -1)
        whole = np.ones(TOYS)
        # The nearer toy changes between meetings.
        nearer = int(t / _MEETING + 0.5) % TOYS
        for k in (1 - nearer, nearer):
            angle = _TURN_DEGREES * np.sin(t / 23.0 + phases[k]) - _TURN_DEGREES * np.sin(phases[k])
            turn = cv2.getRotationMatrix2D((_WIDE / 2, _TALL / 2), angle, 1.0)
            turn[:, 2] += made.middles[k, t] - (_WIDE / 2, _TALL / 2)
            mask = cv2.warpAffine(_mask().astype(np.uint8), turn, (WIDTH, HEIGHT)) > 0
            look = cv2.warpAffine(made.looks[k], turn, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REPLICATE)
            canvas[mask] = look[mask]
            covered[mask] = k
            whole[k] = mask.sum()
        light = 1.0 + _LIGHT * np.sin(t / 31.0)
        noisy = canvas * light + rng.normal(0.0, _NOISE, canvas.shape)
        visible = np.array([(covered == k).sum() for k in range(TOYS)]) / whole
        yield np.clip(np.rint(noisy), 0, 255).astype(np.uint8), visible


def _texture(tall: int, wide: int, spots: int, rng: np.random.Generator) -> Floats:
    coarse = rng.uniform(20.0, 235.0, (spots, spots, 3))
    return np.asarray(np.clip(cv2.resize(coarse, (wide, tall), interpolation=cv2.INTER_CUBIC), 0, 255))


def _mask() -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return a toy's shape: a head on a body."""
    shape = np.zeros((_TALL, _WIDE), dtype=np.uint8)
    cv2.ellipse(shape, (_WIDE // 2, 2 * _TALL // 3), (_WIDE // 2 - 1, _TALL // 3), 0, 0, 360, 1, -1)
    cv2.circle(shape, (_WIDE // 2, _TALL // 4), _TALL // 4 - 1, 1, -1)
    return shape.astype(np.bool_)


def _ways(frames: int, rng: np.random.Generator) -> Floats:
    """Return the toys' centers: back and forth past each other, at a drifting height."""
    t = np.arange(frames)
    along = np.cos(np.pi * t / _MEETING)
    swing = _SWING * along * np.abs(along)  # slow where they meet
    phases = rng.uniform(0.0, 2.0 * np.pi, 4)
    wander = np.stack([15.0 * np.sin(t / (29.0 + 4 * k) + phase) for k, phase in enumerate(phases)])
    x = WIDTH / 2 + np.stack([-swing + wander[0], swing + wander[1]])
    y = HEIGHT / 2 + np.stack([wander[2], wander[3]])
    return np.stack([x, y], axis=-1)


def _boxes(middles: Floats) -> Floats:
    half = np.array([_WIDE / 2, _TALL / 2])
    return np.concatenate([middles - half, middles + half], axis=-1)


def _cut(image: Image, box: Floats) -> Image:
    left, top = (round(float(side)) for side in box[:2])
    return image[top : top + _TALL, left : left + _WIDE].copy()
