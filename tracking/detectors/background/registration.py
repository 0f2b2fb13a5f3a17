"""Registration of frames to the background: a mast that sways, a camera that was knocked.

The motion is a similarity of few pixels (Gauss-Newton on the points of the background with the strongest
edges, Lucas and Kanade 1981; gain and offset of the light are solved for too; Tukey's biweight leaves people
out). It follows the last frame's motion. If the points agree worse than they did, it is sought again from
coarse pictures and by phase correlation.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.background.light.tone_curve import IDENTITY, ToneCurves
from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.base import Image, Mask, Plane
from tracking.frame_rate import DEFAULT_FPS

# Size of the blocks whose pixel with the strongest edge is a point; its least edge, gray levels per pixel.
_BLOCK = 8
_MIN_EDGE = 3.0
_BLUR = (5, 5)
_BLUR_SIGMA = 1.2
# Least and largest limit, in gray levels, for outliers; it is a multiple of the median deviation.
_MIN_OUTLIER, _MAX_OUTLIER, _OUTLIER_MEDIANS = 10.0, 60.0, 4.0
# Deviation of a point that agrees, as a share of its edge over a pixel, and at least, in gray levels.
_AGREE_EDGE, _AGREE_LEVELS = 0.5, 6.0
_STEPS, _STEPS_OF_SEARCH = 1, 6
# Fewest points for a motion, and the share of them that must agree.
_MIN_POINTS = 60
_MIN_AGREEMENT = 0.4
# Drop of the agreement below its average at which the motion is sought again; gain at which one is accepted.
_LOST, _FOUND = 0.12, 0.04
# Motions that differ by less, in pixels at 360 columns, are the same.
_SAME = 0.3
# Largest motion, as a share of the picture's diagonal (larger is another view), and of scale and turn.
_MAX_SHIFT, _MAX_TURN = 0.15, 0.12
_OUTSIDE = -1000.0


class Registration:
    """Follows the motion of one camera's picture against its background."""

    def __init__(self, fps: float = DEFAULT_FPS) -> None:
        self._fps = fps
        self._points: _Points | None = None
        self._motion = self._mean = STILL
        self.agreement = 0.0
        """Share of the background's edges that the last frames have shown, at their light."""
        self._moved_for = self._rested_for = 0.0
        self._age, self._search_age = 0.0, 1.0
        self.rest = STILL
        """Where the camera came to rest; motions around it are sway."""

    def set_background(self, background: Image) -> None:
        """Use a background `(H, W, 3)` from now on."""
        self._points = _Points(_smooth_gray(background))

    def is_due(self) -> bool:
        """Count a frame; return whether to look at it: all, and some of a camera that is at rest."""
        self._age += 1.0 / self._fps
        return self._rested_for < _RESTED_S or self._age >= _LOOK_EVERY_S

    def find(self, image: Image, curves: ToneCurves, unlikely: Mask | None) -> Motion:
        """Return the motion of the next frame.

        Args:
            image: `(H, W, 3)`.
            curves: from the background's levels to about the frame's.
            unlikely: `(H, W)`, not 0 where people are likely.
        """
        points = self._points
        if points is None or points.count < _MIN_POINTS:
            return STILL
        size = (image.shape[1], image.shape[0])
        gray = _smooth_gray(image)
        aligned = points.under(curves, unlikely)
        motion, agreement = aligned.refine(gray, self._motion, _STEPS)
        elapsed, self._age = self._age, 0.0
        self._search_age += elapsed
        if agreement < self.agreement - _LOST and self._search_age >= _LOOK_EVERY_S:
            self._search_age = 0.0
            for start in aligned.coarse_starts(gray, self._motion, self.rest):
                other, other_agreement = aligned.refine(gray, start, _STEPS_OF_SEARCH)
                if other_agreement > agreement + _FOUND:
                    motion, agreement = other, other_agreement
        if agreement < _MIN_AGREEMENT or not _is_plausible(motion, size):
            motion = self.rest
        self.agreement += (agreement - self.agreement) * min(elapsed / _AVERAGE_S, 1.0)
        return self._settle(motion, size, elapsed)

    def find_still(self, image: Image) -> Motion:
        """Return the motion of an image that is not the next frame."""
        points = self._points
        if points is None or points.count < _MIN_POINTS:
            return STILL
        motion, agreement = points.under(IDENTITY, None).refine(_smooth_gray(image), STILL, _STEPS_OF_SEARCH)
        size = (image.shape[1], image.shape[0])
        moved = agreement >= _MIN_AGREEMENT and _is_plausible(motion, size)
        return motion if moved and motion.distance(STILL, size) >= _SAME * size[0] / 360.0 else STILL

    def share_seen(self, image: Image) -> float:
        """Return which share of the background's edges an image shows where they are, at whatever light.

        All of those of a background without edges.
        """
        points = self._points
        if points is None or points.count < _MIN_POINTS:
            return 1.0
        return points.under(IDENTITY, None).refine(_smooth_gray(image), STILL, _STEPS_OF_SEARCH)[1]

    def search(self, image: Image) -> Motion | None:
        """Return the likeliest motion of an image at any light, from anywhere; None: none is plausible.

        A background without edges never moves.
        """
        points = self._points
        if points is None or points.count < _MIN_POINTS:
            return STILL
        gray = _smooth_gray(image)
        alignment = points.under(IDENTITY, None)
        starts = (STILL, *alignment.coarse_starts(gray, STILL))
        found = (alignment.refine(gray, start, _STEPS_OF_SEARCH) for start in starts)
        motion, _ = max(found, key=lambda each: each[1])
        return motion if _is_plausible(motion, (image.shape[1], image.shape[0])) else None

    def _settle(self, motion: Motion, size: tuple[int, int], elapsed: float) -> Motion:
        """Return the motion, or the rest where they are the same; a lasting one becomes the rest."""
        self._motion = motion
        share = min(elapsed / _AVERAGE_S, 1.0)
        self._mean = Motion(
            *(
                old + share * (new - old)
                for old, new in zip(_values(self._mean), _values(motion), strict=True)
            )
        )
        same = _SAME * size[0] / 360.0
        lasting = (
            self._mean.distance(self.rest, size) > 2.0 * same and motion.distance(self._mean, size) < same
        )
        self._moved_for = self._moved_for + elapsed if lasting else 0.0
        if self._moved_for >= _REST_S:
            self.rest, self._moved_for = self._mean, 0.0
        rests = motion.distance(self.rest, size) < same
        self._rested_for = self._rested_for + elapsed if rests else 0.0
        return self.rest if rests else motion


# Seconds over which motion and agreement are averaged, and until a lasting motion is the rest.
_AVERAGE_S, _REST_S = 0.6, 1.0
# Seconds after which a camera that did not move is looked at less often, and between looks and searches then.
_RESTED_S, _LOOK_EVERY_S = 2.0, 0.2


def _values(motion: Motion) -> tuple[float, float, float, float]:
    return motion.x, motion.y, motion.grow, motion.turn


def _is_plausible(motion: Motion, size: tuple[int, int]) -> bool:
    shift = np.hypot(motion.x, motion.y) <= _MAX_SHIFT * np.hypot(*size)
    return bool(shift and abs(motion.grow) <= _MAX_TURN and abs(motion.turn) <= _MAX_TURN)


def _smooth_gray(image: Image) -> Plane:
    gray = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), _BLUR, _BLUR_SIGMA)
    return gray.astype(np.float32)


def count_edges(image: Image) -> int:
    """Return how many parts of an image have edges that show whether it has moved."""
    return _Points(_smooth_gray(image)).count


class _Points:
    """The strongest edges of a background."""

    def __init__(self, gray: Plane) -> None:
        self.gray = gray
        x, y = cv2.Sobel(gray, cv2.CV_32F, 1, 0) / 8.0, cv2.Sobel(gray, cv2.CV_32F, 0, 1) / 8.0
        edge = np.abs(x) + np.abs(y)
        edge[:_MARGIN], edge[-_MARGIN:], edge[:, :_MARGIN], edge[:, -_MARGIN:] = 0.0, 0.0, 0.0, 0.0
        rows, columns = gray.shape[0] // _BLOCK, gray.shape[1] // _BLOCK
        blocks = edge[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
        best = blocks.transpose(0, 2, 1, 3).reshape(rows, columns, _BLOCK**2).argmax(axis=2)
        row = (np.arange(rows)[:, None] * _BLOCK + best // _BLOCK).ravel()
        column = (np.arange(columns)[None] * _BLOCK + best % _BLOCK).ravel()
        strong = edge[row, column] >= _MIN_EDGE
        self.row, self.column = row[strong], column[strong]
        self.count = len(self.row)
        self.levels = gray[self.row, self.column]
        self.slopes = np.stack([x[self.row, self.column], y[self.row, self.column]])

    def under(self, curves: ToneCurves, unlikely: Mask | None) -> _Alignment:
        """Return the points at the levels of a frame, less those where people are likely."""
        table = curves.gray_table()
        level = np.rint(self.levels).astype(np.int64)
        slopes = self.slopes * np.gradient(table)[level]
        weight = np.ones(self.count)
        if unlikely is not None:
            likely = unlikely[self.row, self.column] == 0
            if np.count_nonzero(likely) >= _MIN_POINTS:
                weight = likely.astype(np.float64)
        return _Alignment(self, table, table[level], slopes, weight)


_MARGIN = 3


@dataclass(frozen=True, slots=True, eq=False)
class _Alignment:
    points: _Points
    table: Floats
    levels: Floats
    slopes: Floats
    weight: Floats

    def refine(self, gray: Plane, start: Motion, steps: int) -> tuple[Motion, float]:
        """Return the motion after some steps from a start, and the share of the points that agree."""
        height, width = gray.shape
        radius = width / 2.0
        across, down = self.points.column - width / 2.0, self.points.row - height / 2.0
        x, y = self.slopes
        terms = np.stack(
            [
                x,
                y,
                (x * across + y * down) / radius,
                (y * across - x * down) / radius,
                -self.levels,
                -np.ones_like(x),
            ]
        )
        motion, gain, offset = start, 1.0, 0.0
        for _ in range(steps):
            deviation = gain * self.levels + offset - self._sample(gray, motion)
            seen = np.abs(deviation) < -_OUTSIDE / 2.0
            if np.count_nonzero(seen) < _MIN_POINTS:
                return start, 0.0
            spread = float(np.median(np.abs(deviation[seen])))
            outlier = min(max(_OUTLIER_MEDIANS * spread, _MIN_OUTLIER), _MAX_OUTLIER)
            weight = self.weight * np.maximum(1.0 - (deviation / outlier) ** 2, 0.0) ** 2
            matrix = (terms * weight) @ terms.T + np.diag(_RIDGE)
            change = np.linalg.solve(matrix, (terms * weight) @ deviation)
            motion = Motion(
                motion.x + float(change[0]),
                motion.y + float(change[1]),
                motion.grow + float(change[2]) / radius,
                motion.turn + float(change[3]) / radius,
            )
            gain, offset = gain + float(change[4]), offset + float(change[5])
        deviation = np.abs(gain * self.levels + offset - self._sample(gray, motion))
        allowed = np.maximum(_AGREE_EDGE * np.abs(self.slopes).sum(axis=0), _AGREE_LEVELS)
        return motion, float((self.weight * (deviation <= allowed)).sum() / self.weight.sum())

    def _sample(self, gray: Plane, motion: Motion) -> Floats:
        """Return the frame's levels at the points."""
        matrix = motion.matrix((gray.shape[1], gray.shape[0]))
        at = matrix[:, :2] @ np.stack([self.points.column, self.points.row]) + matrix[:, 2:]
        at = at.astype(np.float32)
        sampled = cv2.remap(
            gray, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_OUTSIDE
        )
        return np.asarray(sampled[:, 0], dtype=np.float64)

    def coarse_starts(self, gray: Plane, *motions: Motion) -> list[Motion]:
        """Return motions found on pictures of a quarter of the size, from some and a phase correlation."""
        level = np.clip(np.rint(self.points.gray), 0, len(self.table) - 1).astype(np.int64)
        expected = _quarter(self.table.astype(np.float32)[level])
        small = _quarter(gray)
        x, y = _phase_shift(expected, small)
        points = _Points(expected)
        if points.count < _MIN_POINTS // 2:
            return [Motion(4.0 * x, 4.0 * y)]
        coarse = _Alignment(points, self.table, points.levels, points.slopes, np.ones(points.count))
        starts = [*(Motion(m.x / 4.0, m.y / 4.0, m.grow, m.turn) for m in motions), Motion(x, y)]
        found = [coarse.refine(small, start, _STEPS_OF_SEARCH)[0] for start in starts]
        return [Motion(4.0 * m.x, 4.0 * m.y, m.grow, m.turn) for m in found]


# Holds what the points leave open: of shift, scale, turn, gain and offset.
_RIDGE = (1.0, 1.0, 10.0, 10.0, 1e4, 10.0)


def _quarter(plane: Plane) -> Plane:
    return np.asarray(cv2.pyrDown(cv2.pyrDown(plane)), dtype=np.float32)


def _phase_shift(one: Plane, other: Plane) -> tuple[float, float]:
    """Return by how many pixels the edges of a plane have moved to another, by their phase correlation."""
    window = cv2.createHanningWindow((one.shape[1], one.shape[0]), cv2.CV_32F)
    (x, y), _ = cv2.phaseCorrelate(_edges(one), _edges(other), window)
    return float(x), float(y)


def _edges(plane: Plane) -> Plane:
    """Return the strength of the edges, which does not depend on the light as levels do."""
    x, y = cv2.Sobel(plane, cv2.CV_32F, 1, 0), cv2.Sobel(plane, cv2.CV_32F, 0, 1)
    return np.asarray(np.minimum(cv2.magnitude(x, y), _MAX_STRENGTH), dtype=np.float32)


_MAX_STRENGTH = 100.0
