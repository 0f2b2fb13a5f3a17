"""Clips of a synthetic scene, detected by connected components of the foreground.

As in the thesis (Todor 2009, section 8.2) every large enough component is a detection; so are the parts into
which it falls when eroded a little, since touching bodies form one component. Foreground are the pixels with
colors of objects that differ from the median picture: swaying weeds differ, too, but their colors do not. The
score of a component is the foreground share of its colors.
The court's people are detected by MyView's own detector for upright people.
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
"""Pictures for the median background, and frames between them."""
_DIFFERS = 32
"""Gray levels by which the changes of a foreground pixel's channels differ."""
_FOREGROUND_SHARE = 0.3
"""Foreground share from which a color is foreground."""
_SURE = 0.7
"""Mean foreground share of a component with score 1."""
_LEAST_AREA = 80
"""Least pixels of a component."""
_EROSIONS, _LEAST_CORE = (2, 4), 25
"""Erosions that separate touching bodies, pixels, and the least pixels that remain of each."""
_LEAST_PART = 0.2
"""Least share of the eroded component in a part: less is a fin."""


@dataclass(frozen=True, slots=True)
class ClipScene:
    """The synthetic scene of clips."""

    scene: str
    objects: int
    seconds: float = 20.0
    fps: float = 30.0
    size: tuple[int, int] = (640, 480)
    people: bool = False


class ForegroundBlobDetector:
    """Detects connected components of the foreground."""

    def __init__(self, ahead: Sequence[Image]) -> None:
        background = np.median(np.stack(ahead), axis=0).astype(np.uint8)
        self._looks = AppearanceExtractor()
        self._round = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        self._wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
        self._colors = ForegroundColors((image, self._differing(image, background)) for image in ahead)

    def _differing(self, image: Image, background: Image) -> Mask:
        """Return the pixels that differ from the background, `(H, W)`."""
        # Caustics change all channels alike, objects do not.
        change = cv2.subtract(image, background, dtype=cv2.CV_16S)
        mask = np.where(np.ptp(change, axis=2) >= _DIFFERS, np.uint8(255), np.uint8(0))
        return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, self._round), dtype=np.uint8)

    def _bodies(self, shares: Plane) -> Mask:
        """Return a mask of foreground colors, `(H, W)`, closed and opened, so that nothing is thin."""
        mask = np.where(shares >= _FOREGROUND_SHARE, np.uint8(255), np.uint8(0))
        whole = cv2.morphologyEx(cv2.medianBlur(mask, 3), cv2.MORPH_CLOSE, self._wide)
        return np.asarray(cv2.morphologyEx(whole, cv2.MORPH_OPEN, self._round), dtype=np.uint8)

    def detect(self, image: Image) -> Detections:
        """Return the detections in a picture."""
        shares = self._colors.shares(image)
        mask = self._bodies(shares)
        sums = (
            cv2.integral(shares.astype(np.float64) * (mask > 0)),
            cv2.integral((mask > 0).astype(np.float64)),
        )
        labels, whole = _components(mask, _LEAST_AREA)
        boxes = np.concatenate([whole, *(_parts(mask, labels, erosion) for erosion in _EROSIONS)])
        total, area = (_inside(np.asarray(table), boxes) for table in sums)
        scores = np.minimum(total / np.maximum(area, 1.0) / _SURE, 1.0)
        return Detections(boxes, scores, self._looks.histograms(image, boxes, mask))


def _components(mask: Mask, least: int) -> tuple[NDArray[np.int32], Floats]:
    """Return the connected components of a mask: each pixel's label, and the boxes `(K, 4)` of large ones."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    large = stats[1:][stats[1:, cv2.CC_STAT_AREA] >= least]
    corner = large[:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]].astype(np.float64)
    size = large[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    return np.asarray(labels, dtype=np.int32), np.concatenate([corner, corner + size], axis=1)


def _parts(mask: Mask, labels: NDArray[np.int32], erosion: int) -> Floats:
    """Return the boxes `(K, 4)` of the large parts into which components fall when eroded.

    Each pixel of a component belongs to the nearest part, since erosion removes tails.
    """
    size = 2 * erosion + 1
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
    """Return the sums over boxes `(K, 4)` from an integral image."""
    height, width = table.shape
    left, top, right, bottom = np.clip(boxes, 0, [width - 1, height - 1] * 2).astype(np.int64).T
    return np.asarray(table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left])


def render_clip(film: ClipScene, seed: int) -> Clip:
    """Render and detect a clip of the first camera of a scene."""
    played = Scene(film.scene, 1, film.objects, seed, *film.size, film.fps)
    count = round(film.seconds * film.fps)
    detector = _detector(film, [played.image(0, place * _EVERY) for place in range(_AHEAD)])
    boxes = np.full((film.objects, count, BOX_SIDES), np.nan)
    visible = np.zeros((film.objects, count))
    detections = []
    for t in range(count):
        detections.append(detector.detect(played.image(0, t)))
        there = played.truth(t)[0]
        boxes[there.ids - 1, t] = there.boxes
        visible[there.ids - 1, t] = there.visibility
    return Clip(seed, film.fps, tuple(detections), ObjectTruth(boxes, visible))


def _detector(film: ClipScene, ahead: Sequence[Image]) -> ForegroundBlobDetector | BackgroundDetector:
    if not film.people:
        return ForegroundBlobDetector(ahead)
    detector = BackgroundDetector(fps=film.fps)
    detector.prepare(ahead, _EVERY / film.fps)
    return detector
