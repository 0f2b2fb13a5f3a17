"""Clips of a drawn scene, with what stands out from its background: one box for each piece of foreground.

As in the thesis (Todor 2009, section 8.2): what differs enough from the median of pictures seen before is
foreground, and every connected piece of it that is large enough is found, with how much it differs as its
score; so are the parts that it falls into when it is eroded a little, since bodies that touch are one piece.
MyView's own detector looks for upright people: those of the court are found by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.assist_clips import Clip
from benchmarks.experiments_scene import Truth
from server.camera.scene import Scene
from tracking import Detections
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors import BackgroundDetector, Image
from tracking.detectors.base import Mask
from tracking.detectors.looks import Looks

_AHEAD, _EVERY = 31, 20
"""Pictures of which the background is the median, and frames between them."""
_DIFFERS = 32
"""Grey levels by which the changes of a pixel's channels must differ."""
_SURE = 100.0
"""Mean difference of a piece that is surely somebody."""
_LEAST_AREA = 80
"""Pixels of a piece."""
_THINNER, _LEAST_CORE = (2, 4), 25
"""Pixels by which the foreground is eroded to part bodies that touch, and pixels of what is left of each."""
_LEAST_PART = 0.2
"""Share of what is left of a piece that a part has: less is a fin."""


@dataclass(frozen=True, slots=True)
class Film:
    """What clips are made of."""

    scene: str
    objects: int
    seconds: float = 20.0
    fps: float = 30.0
    size: tuple[int, int] = (640, 480)
    people: bool = False


class Blobs:
    """Finds pieces of foreground."""

    def __init__(self, ahead: Sequence[Image]) -> None:
        self._background = np.median(np.stack(ahead), axis=0).astype(np.uint8)
        self._looks = Looks()
        self._round = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        self._wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))

    def detect(self, image: Image) -> Detections:
        """Give what is found in a picture."""
        # Light that plays on the ground changes all channels alike: what counts is that they change apart.
        change = cv2.subtract(image, self._background, dtype=cv2.CV_16S)
        difference = change.max(axis=2) - change.min(axis=2)
        mask = np.where(difference >= _DIFFERS, np.uint8(255), np.uint8(0))
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, self._round)
        mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, self._wide), dtype=np.uint8)
        sums = (
            cv2.integral(difference.astype(np.float64) * (mask > 0)),
            cv2.integral((mask > 0).astype(np.float64)),
        )
        labels, whole = _pieces(mask, _LEAST_AREA)
        boxes = np.concatenate([whole, *(_parts(mask, labels, thinner) for thinner in _THINNER)])
        total, area = (_inside(np.asarray(table), boxes) for table in sums)
        scores = np.minimum(total / np.maximum(area, 1.0) / _SURE, 1.0)
        return Detections(boxes, scores, self._looks.rows(image, boxes, mask))


def _pieces(mask: Mask, least: int) -> tuple[NDArray[np.int32], Floats]:
    """Give the connected pieces of a mask: each pixel's number, and the boxes `(K, 4)` of the large ones."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    large = stats[1:][stats[1:, cv2.CC_STAT_AREA] >= least]
    corner = large[:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]].astype(np.float64)
    size = large[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    return np.asarray(labels, dtype=np.int32), np.concatenate([corner, corner + size], axis=1)


def _parts(mask: Mask, labels: NDArray[np.int32], thinner: int) -> Floats:
    """Give the boxes `(K, 4)` of the large parts that pieces fall into when eroded by so many pixels."""
    size = 2 * thinner + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    cores = np.asarray(cv2.erode(mask, disc), dtype=np.uint8)
    left = np.bincount(labels[cores > 0], minlength=int(labels.max()) + 1)
    _, numbers, stats, _ = cv2.connectedComponentsWithStats(cores)
    found: dict[int, list[NDArray[np.float64]]] = {}
    for k in range(1, len(stats)):
        x, y, wide, high, area = stats[k].tolist()
        inside = np.flatnonzero(numbers[y : y + high, x : x + wide].ravel() == k)
        piece = int(labels[y : y + high, x : x + wide].ravel()[inside[0]])
        if area >= _LEAST_CORE and area >= _LEAST_PART * left[piece]:
            box = np.array(
                [x - thinner, y - thinner, x + wide + thinner, y + high + thinner], dtype=np.float64
            )
            found.setdefault(piece, []).append(box)
    parts = [box for boxes in found.values() if len(boxes) > 1 for box in boxes]
    return np.stack(parts) if parts else np.empty((0, BOX_SIDES))


def _inside(table: Floats, boxes: Floats) -> Floats:
    """Give the sums over boxes `(K, 4)` of whole pixels, from an integral image."""
    height, width = table.shape
    left, top, right, bottom = np.clip(boxes, 0, [width - 1, height - 1] * 2).astype(np.int64).T
    return np.asarray(table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left])


def drawn(film: Film, seed: int) -> Clip:
    """Give a clip of the first camera of a scene."""
    played = Scene(film.scene, 1, film.objects, seed, *film.size, film.fps)
    count = round(film.seconds * film.fps)
    detector = _detector(film, [played.image(0, place * _EVERY) for place in range(_AHEAD)])
    boxes = np.full((film.objects, count, BOX_SIDES), np.nan)
    visible = np.zeros((film.objects, count))
    seen = []
    for t in range(count):
        seen.append(detector.detect(played.image(0, t)))
        there = played.truth(t)[0]
        boxes[there.ids - 1, t] = there.boxes
        visible[there.ids - 1, t] = there.visible
    return Clip(seed, film.fps, tuple(seen), Truth(boxes, visible))


def _detector(film: Film, ahead: Sequence[Image]) -> Blobs | BackgroundDetector:
    if not film.people:
        return Blobs(ahead)
    detector = BackgroundDetector()
    detector.prepare(ahead, _EVERY)
    return detector
