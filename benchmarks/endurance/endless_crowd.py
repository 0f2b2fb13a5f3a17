"""Simulated detections of an endless crowd in which people come and go."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.paper_experiments.gray_histograms import visible, wardrobe
from benchmarks.paper_experiments.noisy_detections import SceneParameters, detect
from benchmarks.paper_experiments.walking_people import Walker, WalkParameters, inside, people_at
from tracking import Detections

_WALKING = WalkParameters(3.0, 0.15, stay=(150, 500), away=(20, 200))


def crowd(most: int, seed: int) -> Iterator[Detections]:
    """Yield the detections of at most `most` people at once, forever.

    New people have new clothes: tracks are initiated and forgotten all the time.
    """
    rng = np.random.default_rng(seed)
    cast = SceneParameters(tuple(range(most)), 0, _WALKING)
    clothes = wardrobe(cast.kits, rng)
    walkers = [Walker(_WALKING, np.array([rng.uniform(0, 300), 200.0]), rng) for _ in range(most)]
    away = np.zeros(most, dtype=np.bool_)
    while True:
        feet = np.array([walker.step() for walker in walkers])
        gone = np.isnan(feet[:, 0])
        new = away & ~gone
        if new.any():
            fresh = wardrobe(cast.kits, rng)
            clothes = replace(clothes, halves=np.where(new[:, None, None], fresh.halves, clothes.halves))
        away = gone
        boxes = inside(people_at(feet, cast.height))
        yield detect(cast, boxes, visible(boxes), clothes, rng)
