"""Clips of a drawn scene, with what stands out from its background: one box for each piece of foreground.

As in the thesis (Todor 2009, section 8.2) every connected piece of foreground that is large enough is found;
so are the parts that it falls into when it is eroded a little, since bodies that touch are one piece.
Foreground is what has the colors of what differs from the median of pictures seen before: weeds that sway
differ, too, but not their colors, and the pale bands of a fish belong to it. The score of a piece is how
surely its colors are foreground.
MyView's own detector looks for upright people: those of the court are found by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.operator_assist.background_colors import ForegroundColors
from benchmarks.operator_assist.clips import Clip
from benchmarks.paper_experiments.scene import ObjectTruth
from synthetic import Scene
from tracking import Detections
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors import BackgroundDetector, Image
from tracking.detectors.base import Mask, Plane
from tracking.detectors.color_histogram import AppearanceExtractor

_AHEAD, _EVERY = 31, 20
"""Pictures of which the background is the median, and frames between them."""
_DIFFERS = 32
"""Gray levels by which the changes of a pixel's channels must differ."""
_FAMILIAR = 0.3
"""Share of foreground from which a color is one."""
_SURE = 0.7
"""Mean share of the colors of a piece that is surely somebody."""
_LEAST_AREA = 80
"""Pixels of a piece."""
_THINNER, _LEAST_CORE = (2, 4), 25
"""Pixels by which the foreground is eroded to part bodies that touch, and pixels of what is left of each."""
_LEAST_PART = 0.2
"""Share of what is left of a piece that a part has: less is a fin."""


@dataclass(frozen=True, slots=True)
class ClipScene:
    """What clips are made of."""

    scene: str
    objects: int
    seconds: float = 20.0
    fps: float = 30.0
    size: tuple[int, int] = (640, 480)
    people: bool = False


class ForegroundBlobDetector:
    """Finds pieces of foreground."""

    def __init__(self, ahead: Sequence[Image]) -> None:
        background = np.median(np.stack(ahead), axis=0).astype(np.uint8)
        self._looks = AppearanceExtractor()
        self._round = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        self._wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
        self._familiar = ForegroundColors((image, self._differing(image, background)) for image in ahead)

    def _differing(self, image: Image, background: Image) -> Mask:
        """Return what differs from the background, `(H, W)`."""
        # Light that plays on the ground changes all channels alike: what counts is that they change apart.
        change = cv2.subtract(image, background, dtype=cv2.CV_16S)
        mask = np.where(np.ptp(change, axis=2) >= _DIFFERS, np.uint8(255), np.uint8(0))
        return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, self._round), dtype=np.uint8)

    def _bodies(self, shares: Plane) -> Mask:
        """Return a mask of familiar colors, `(H, W)`: whole bodies with their pale bands, nothing thin."""
        mask = np.where(shares >= _FAMILIAR, np.uint8(255), np.uint8(0))
        whole = cv2.morphologyEx(cv2.medianBlur(mask, 3), cv2.MORPH_CLOSE, self._wide)
        return np.asarray(cv2.morphologyEx(whole, cv2.MORPH_OPEN, self._round), dtype=np.uint8)

    def detect(self, image: Image) -> Detections:
        """Return what is found in a picture."""
        shares = self._familiar.shares(image)
        mask = self._bodies(shares)
        sums = (
            cv2.integral(shares.astype(np.float64) * (mask > 0)),
            cv2.integral((mask > 0).astype(np.float64)),
        )
        labels, whole = _pieces(mask, _LEAST_AREA)
        boxes = np.concatenate([whole, *(_parts(mask, labels, thinner) for thinner in _THINNER)])
        total, area = (_inside(np.asarray(table), boxes) for table in sums)
        scores = np.minimum(total / np.maximum(area, 1.0) / _SURE, 1.0)
        return Detections(boxes, scores, self._looks.histograms(image, boxes, mask))


def _pieces(mask: Mask, least: int) -> tuple[NDArray[np.int32], Floats]:
    """Return connected pieces of a mask: each pixel's number, and the boxes `(K, 4)` of the large ones."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    large = stats[1:][stats[1:, cv2.CC_STAT_AREA] >= least]
    corner = large[:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]].astype(np.float64)
    size = large[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    return np.asarray(labels, dtype=np.int32), np.concatenate([corner, corner + size], axis=1)


def _parts(mask: Mask, labels: NDArray[np.int32], thinner: int) -> Floats:
    """Return the boxes `(K, 4)` of the large parts that pieces fall into when eroded by so many pixels.

    To a part belongs what of its piece is nearer to it than to the others: erosion takes tails off.
    """
    size = 2 * thinner + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    cores = np.asarray(cv2.erode(mask, disc), dtype=np.uint8)
    left = np.bincount(labels[cores > 0], minlength=int(labels.max()) + 1)
    _, numbers, stats, _ = cv2.connectedComponentsWithStats(cores)
    area = stats[:, cv2.CC_STAT_AREA]
    piece = np.zeros(len(stats), dtype=np.int64)
    piece[numbers[cores > 0]] = labels[cores > 0]
    large = (piece > 0) & (area >= _LEAST_CORE) & (area >= _LEAST_PART * left[piece])
    large &= np.bincount(piece[large], minlength=len(left))[piece] > 1
    if not large.any():
        return np.empty((0, BOX_SIDES))
    far = np.where(large[numbers], np.uint8(0), np.uint8(255))
    _, nearest = cv2.distanceTransformWithLabels(far, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_CCOMP)
    found = []
    for k in np.flatnonzero(large):
        own = nearest == nearest[numbers == k][0]
        x, y, wide, high = cv2.boundingRect((own & (labels == piece[k])).astype(np.uint8))
        found.append([x, y, x + wide, y + high])
    return np.array(found, dtype=np.float64)


def _inside(table: Floats, boxes: Floats) -> Floats:
    """Return the sums over boxes `(K, 4)` of whole pixels, from an integral image."""
    height, width = table.shape
    left, top, right, bottom = np.clip(boxes, 0, [width - 1, height - 1] * 2).astype(np.int64).T
    return np.asarray(table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left])


def drawn(film: ClipScene, seed: int) -> Clip:
    """Return a clip of the first camera of a scene."""
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
        visible[there.ids - 1, t] = there.visibility
    return Clip(seed, film.fps, tuple(seen), ObjectTruth(boxes, visible))


def _detector(film: ClipScene, ahead: Sequence[Image]) -> ForegroundBlobDetector | BackgroundDetector:
    if not film.people:
        return ForegroundBlobDetector(ahead)
    detector = BackgroundDetector()
    detector.prepare(ahead, _EVERY)
    return detector
