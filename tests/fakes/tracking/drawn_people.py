"""Pictures with drawn people and noise for detector tests, all from a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors import BackgroundDetector
from tracking.types import Detections

HEIGHT, WIDTH = 288, 360
Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Figure:
    """A person walking along a row of the picture; the height follows from the row of the feet."""

    left: float
    foot: float
    speed: float = 0.0
    begin: int = 0
    end: int = 10_000
    color: tuple[int, int, int] = (40, 60, 190)

    def box(self, frame: int) -> npt.NDArray[np.float64]:
        """Return left, top, right, bottom."""
        tall = 0.7 * self.foot - 40.0
        left = self.left + self.speed * frame
        return np.array([left, self.foot - tall, left + 0.36 * tall, self.foot])


def _scene() -> Picture:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    scene = np.full((HEIGHT, WIDTH, 3), (150, 160, 165), dtype=np.uint8)
    scene[(rows > HEIGHT // 3) & ((rows // 24 + columns // 30) % 2 == 0)] = (125, 130, 140)
    return scene


SCENE = _scene()
NOISE = np.random.default_rng(0).normal(0.0, 3.0, SCENE.shape).astype(np.int16)


def picture(figures: Sequence[Figure], frame: int, gain: float = 1.0) -> Picture:
    """Draw the figures of a frame before a wall with a checkered floor."""
    canvas = SCENE.copy()
    for figure in sorted(figures, key=lambda figure: figure.foot):
        if figure.begin <= frame < figure.end:
            draw(canvas, figure, frame)
    noise = np.roll(NOISE, (7 * frame, 13 * frame), axis=(0, 1))
    return np.asarray(cv2.add(cv2.convertScaleAbs(canvas, alpha=gain), noise, dtype=cv2.CV_8U))


def detect_all(
    detector: BackgroundDetector, figures: Sequence[Figure], frames: range, gain: float = 1.0
) -> list[Detections]:
    """Run the detector on the frames."""
    return [detector.detect(picture(figures, frame, gain)) for frame in frames]


def draw(canvas: Picture, figure: Figure, frame: int) -> None:
    """Draw a figure where it is in a frame."""
    left, top, right, bottom = figure.box(frame)
    width, tall = right - left, bottom - top

    def part(begin: float, start: float, end: float, stop: float) -> tuple[tuple[int, int], tuple[int, int]]:
        first = (round(left + begin * width), round(top + start * tall))
        return first, (round(left + end * width) - 1, round(top + stop * tall) - 1)

    cv2.rectangle(canvas, *part(0.0, 0.14, 1.0, 0.55), figure.color, -1)
    cv2.rectangle(canvas, *part(0.15, 0.55, 0.45, 1.0), (60, 40, 30), -1)
    cv2.rectangle(canvas, *part(0.55, 0.55, 0.85, 1.0), (60, 40, 30), -1)
    cv2.rectangle(canvas, *part(0.33, 0.0, 0.67, 0.14), (90, 120, 200), -1)
