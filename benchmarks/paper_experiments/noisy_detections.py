"""Simulated noisy detections of squash players and people in an office (paper IV.A.2 to 4 and Example 1).

No pictures are drawn: the program sees only boxes and their appearance. Each frame has inexact boxes, further
boxes of wrong place and size on the same people, false positives, and missed people, more often when
occluded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.paper_experiments.gray_histograms import BINS, Clothing, histogram, visible, wardrobe
from benchmarks.paper_experiments.scene import HEIGHT, WIDTH, ExperimentScene, ObjectTruth
from benchmarks.paper_experiments.walking_people import WalkParameters, inside, people_at, walks
from tracking import Detections, Template
from tracking.boxes import Floats

_LEAST_VISIBLE = 0.3
"""Visible share from which a person can be detected."""


@dataclass(frozen=True, slots=True)
class SceneParameters:
    """The people of a scene and the errors of their detections.

    Attributes:
        kits: the kit number of each person; people of one kit look alike.
        frames: T.
        walking: their motion.
        height: of the nearest person, pixels.
        missed: share of the frames in which a fully visible person is not detected.
        off: standard deviation of a box's place and size, in heights.
        wrong_sizes: mean number of boxes of wrong place and size per person and frame.
        clutter: mean number of false positives per frame.
        known: the objects are known in the first frame; otherwise they must be detected.
    """

    kits: tuple[int, ...]
    frames: int
    walking: WalkParameters
    height: float = 110.0
    missed: float = 0.04
    off: float = 0.03
    wrong_sizes: float = 1.0
    clutter: float = 2.0
    known: bool = True


def play(cast: SceneParameters, seed: int) -> ExperimentScene:
    """Simulate a scene; deterministic by seed."""
    rng = np.random.default_rng(seed)
    clothes = wardrobe(cast.kits, rng)
    feet = walks(len(cast.kits), cast.frames, cast.walking, rng)
    boxes = inside(people_at(feet, cast.height))
    shares = np.array([visible(boxes[:, t]) for t in range(cast.frames)]).T
    seen = tuple(detect(cast, boxes[:, t], shares[:, t], clothes, rng) for t in range(cast.frames))
    templates: tuple[Template, ...] = ()
    if cast.known:
        templates = tuple(
            Template(k + 1, histogram(boxes[k, 0], boxes[:, 0], clothes, rng), boxes[k, 0])
            for k in range(len(cast.kits))
        )
    return ExperimentScene(ObjectTruth(boxes, shares), (seen,), templates, cast.kits)


def detect(
    cast: SceneParameters, people: Floats, shares: Floats, clothes: Clothing, rng: np.random.Generator
) -> Detections:
    """Return the detections of one frame, in random order.

    `people` are boxes `(n, 4)`, NaN while absent; `shares` `(n,)` their visible shares.
    """
    found: list[tuple[Floats, float]] = []
    for box, share in zip(people, shares, strict=True):
        if share < _LEAST_VISIBLE:
            continue
        if rng.random() > cast.missed + 0.5 * (1.0 - share):
            found.append((_moved(box, cast.off, rng), rng.uniform(0.6, 1.0) * share))
        found.extend(
            (_moved(box, 4 * cast.off, rng), rng.uniform(0.2, 0.7) * share)
            for _ in range(rng.poisson(cast.wrong_sizes))
        )
    for _ in range(rng.poisson(cast.clutter)):
        feet = np.array([rng.uniform(20, WIDTH - 20), rng.uniform(150, HEIGHT)])
        found.append((people_at(feet, cast.height * rng.uniform(0.6, 1.0)), rng.uniform(0.0, 0.5)))
    order = rng.permutation(len(found))
    boxes = np.array([found[k][0] for k in order]).reshape(-1, 4)
    scores = np.array([found[k][1] for k in order])
    looks = np.array([histogram(box, people, clothes, rng) for box in boxes]).reshape(-1, BINS)
    return Detections(boxes, scores, looks)


def _moved(box: Floats, off: float, rng: np.random.Generator) -> Floats:
    """Move a box and change its size at random, by `off` heights."""
    tall, wide = box[3] - box[1], box[2] - box[0]
    middle = np.array([box[0] + box[2], box[1] + box[3]]) / 2 + rng.normal(0.0, off * tall, 2)
    half = np.array([wide, tall]) / 2 * np.exp(rng.normal(0.0, 1.5 * off))
    return np.concatenate([middle - half, middle + half])
