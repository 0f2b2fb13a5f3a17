"""Drawn people who occlude each other for a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tracking.baselines.stepwise import PredictionMethod
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image

SIZE = (120, 200)
FRAMES = 58
_TALL, _WIDE = 44, 18

Clothes = tuple[tuple[int, int, int], tuple[int, int, int]]
"""Colors of the upper and the lower half."""

RED: Clothes = ((40, 40, 220), (90, 40, 30))
BLUE: Clothes = ((220, 60, 30), (40, 40, 160))
GREEN: Clothes = ((50, 190, 60), (40, 90, 40))
GRAY: Clothes = ((120, 110, 90), (100, 90, 70))


@dataclass(frozen=True)
class Crossing:
    """The first person walks right, behind the second, who walks left."""

    clothes: tuple[Clothes, ...]
    """Of each person, from back to front."""
    seed: int = 0

    def left(self, person: int, frame: int) -> float:
        """Return the left edge of a person's box, pixels."""
        return 20.0 + 2.5 * frame if person == 0 else 160.0 - 2.5 * frame

    def where(self, person: int, frame: int) -> Floats:
        left = self.left(person, frame)
        return np.array([left, 40.0, left + _WIDE, 40.0 + _TALL])

    def picture(self, frame: int) -> Image:
        rng = np.random.default_rng(self.seed)
        image = rng.integers(90, 130, (*SIZE, 3)).astype(np.uint8)
        texture = rng.integers(-25, 25, (_TALL, _WIDE, 1))
        self.furnish(image, texture)
        for person in self.present(frame):
            clothes = self.clothes[person]
            left, top = np.rint(self.where(person, frame)[:2]).astype(int).tolist()
            _dress(image, left, top, np.array(clothes), texture)
        return image

    def present(self, frame: int) -> Sequence[int]:  # noqa: ARG002
        """Return who is in the picture, from back to front."""
        return range(len(self.clothes))

    def furnish(self, image: Image, texture: Floats) -> None:
        """Draw objects of the background."""


@dataclass(frozen=True)
class WalkTogether(Crossing):
    """The first person catches up with the second, walks behind them, and falls back.

    An object in similar colors stands where the first is occluded.
    """

    def left(self, person: int, frame: int) -> float:
        if person == 1:
            return 60.0 + 2.0 * frame
        return float(np.interp(frame, [0, 25, 40, 58], [20, 110, 140, 147]))

    def furnish(self, image: Image, texture: Floats) -> None:
        faded = 0.6 * np.array(self.clothes[0]) + 0.4 * 110
        _dress(image, 125, 66, faded, texture)


@dataclass(frozen=True)
class EnterAndLeave(Crossing):
    """The second person enters in frame 12, nearer to the camera; the first leaves in frame 40."""

    def where(self, person: int, frame: int) -> Floats:
        return super().where(person, frame) + np.array([0.0, 1.0, 0.0, 1.0]) * (-35.0 + 65.0 * person)

    def present(self, frame: int) -> Sequence[int]:
        return [person for person in range(2) if 12 * person <= frame < 40 + 30 * person]


@dataclass(frozen=True)
class ThreeMeet(Crossing):
    """Two people pass each other behind a third, who stands."""

    def left(self, person: int, frame: int) -> float:
        return 90.0 if person == 2 else super().left(person, frame)


def _dress(image: Image, left: int, top: int, clothes: Floats, texture: Floats) -> None:
    colors = np.repeat(clothes, _TALL // 2, axis=0)[:, None]
    image[top : top + _TALL, left : left + _WIDE] = np.clip(colors + texture, 0, 255)


def track_people(method: PredictionMethod[Any], scene: Crossing) -> list[bool]:
    """Track all people from the first picture to the last; return whether each is found at the end."""
    image = scene.picture(0)
    people = [method.initialize(image, scene.where(person, 0)) for person in range(len(scene.clothes))]
    for frame in range(1, FRAMES):
        method.predict(scene.picture(frame), people)
    return [
        float(iou(person_track.box, scene.where(person, FRAMES - 1))) > 0.4
        for person, person_track in enumerate(people)
    ]


def count_tracked_scenes(methods: Sequence[PredictionMethod[Any]], scenes: Sequence[Crossing]) -> int:
    """Count the scenes in which all people are found at the end, each with a new method."""
    return sum(all(track_people(method, scene)) for method, scene in zip(methods, scenes, strict=True))
