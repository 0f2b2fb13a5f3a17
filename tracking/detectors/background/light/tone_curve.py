"""Exposure compensation: one monotone tone curve per channel from the background's levels to a frame's.

Automatic exposure, white balance, gamma and the compression of highlights change what level a camera gives to
the same light. A curve is piecewise linear between `_KNOTS`. It is fitted to pixel pairs by reweighted least
squares (Tukey's biweight), with few parameters and drawn towards the previous frame's curve and a straight
line, so that people who cover most of the picture, and levels that the background lacks, do not bend it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.base import Image, Mask

# About this many pixels in each row of the picture, and as many rows per length, enter a fit.
_COLUMNS = 40
_LEVELS = 256
_CHANNELS = 3
_KNOTS = np.linspace(0.0, _LEVELS, 9)
_SPACING = _KNOTS[1]
# Levels of the background that are neither black nor clipped. A frame's level above the larger is clipped.
_MIN_LEVEL, _MAX_LEVEL = 4, 250
# Strength of the priors, in pixels: the previous curve at each knot, and a straight line through three knots.
_PREVIOUS_PIXELS, _STRAIGHT_PIXELS = 8.0, 6.0
# Deviation, in gray levels, beyond which a pair counts as a person; and while a start is refined.
_OUTLIER = 14.0
_OUTLIERS_OF_SEARCH = (24.0, 18.0, _OUTLIER)
# A jump of the exposure is sought if less than a share of the pairs agree with the curve that was tracked, or
# so many fewer than in the frame before; and found if a curve has so many more.
_TRACKED_SHARE, _JUMP_SHARE, _BETTER_SHARE = 0.6, 0.03, 0.1
# Levels of the background and of the frame per bin of the histogram in which a jump is sought; the kernel
# that smooths the latter; and the cost, in pixels, of a step that is twice or not at all that of a line.
_PATH_OLD, _PATH_NEW = 16, 4
_PATH_KERNEL = np.array([[1.0, 2.0, 3.0, 2.0, 1.0]]) / 3.0
_PATH_PENALTY = 2.0
# Least slope of a curve, levels per level; below it levels are clipped and cannot be inverted.
_MIN_SLOPE = 0.2


@dataclass(frozen=True, eq=False)
class ToneCurves:
    """The curves of the three channels, and how well the pixels follow them.

    Attributes:
        levels: `(3, K)`, the frame's level at each knot of the background's level, not clipped.
        noise: median deviation of the pixels that follow the curves, as a standard deviation in gray levels.
        agreement: the share of the pixels that follow them.
    """

    levels: Floats
    noise: float = 0.0
    agreement: float = 1.0

    def apply(self, image: Image) -> Image:
        """Return a background `(H, W, 3)` as the camera shows it in the frame."""
        return np.asarray(cv2.LUT(image, self._table), dtype=np.uint8)

    def invert(self, image: Image, background: Image | None = None) -> Image:
        """Return a frame `(H, W, 3)` at the levels of the background.

        Where the background's own levels are clipped in the frame, they are returned if it is given.
        """
        leveled = np.asarray(cv2.LUT(image, self._inverse_table), dtype=np.uint8)
        if background is not None:
            steep = np.gradient(self._table[0].T.astype(np.float64), axis=1) >= _MIN_SLOPE
            if not steep.all():
                clipped = cv2.LUT(background, np.where(steep, 0, 255).astype(np.uint8).T[None].copy())
                np.copyto(leveled, background, where=clipped > 0)
        return leveled

    def contrast_of(self, background: Image) -> float:
        """Return the contrast that a background has in the frame over its own: 0 behind a cover."""
        return float(self.apply(background).std() / max(float(background.std()), 1.0))

    def gray_table(self) -> Floats:
        """Return the frame's gray level for each gray level of the background, `(256,)`."""
        return np.asarray(self._table[0].mean(axis=1, dtype=np.float64))

    @cached_property
    def _table(self) -> Image:
        """The rounded curves, `(1, 256, 3)`."""
        at = np.arange(_LEVELS, dtype=np.float64)
        curves = np.stack([np.interp(at, _KNOTS, levels) for levels in self.levels], axis=1)
        rising = np.maximum.accumulate(curves, axis=0)
        return np.asarray(np.rint(np.clip(rising, 0.0, _LEVELS - 1.0))[None], dtype=np.uint8)

    @cached_property
    def _inverse_table(self) -> Image:
        """The level of the background at each level of the frame, `(1, 256, 3)`."""
        levels = np.arange(_LEVELS, dtype=np.float64)
        rising = self._table[0].T + 1e-3 * levels
        inverse = np.stack([np.interp(levels, curve, levels) for curve in rising], axis=1)
        return np.asarray(np.rint(inverse[None]), dtype=np.uint8)


IDENTITY = ToneCurves(np.tile(_KNOTS, (_CHANNELS, 1)))


def fit_tone_curves(
    image: Image, background: Image, unlikely: Mask | None = None, previous: ToneCurves | None = None
) -> ToneCurves:
    """Return the curves from a background to an image, both `(H, W, 3)`.

    Args:
        image: the frame.
        background: what it shows without people, at other levels.
        unlikely: `(H, W)`, not 0 where people are likely.
        previous: the curves of the frame before; None: nothing is known.
    """
    step = max(image.shape[1] // _COLUMNS, 1)
    begin = step // 2
    old = background[begin::step, begin::step].reshape(-1, _CHANNELS).T
    new = image[begin::step, begin::step].reshape(-1, _CHANNELS).T
    usable = (old >= _MIN_LEVEL) & (old <= _MAX_LEVEL)
    if unlikely is not None:
        likely = unlikely[begin::step, begin::step].ravel() == 0
        if 4 * np.count_nonzero(likely) > likely.size:
            usable &= likely
    pairs = _Pairs(old, new.astype(np.float64), usable)
    start = (previous or IDENTITY).levels
    tracked = pairs.refine(start, start, (_OUTLIER,))
    if previous is not None and tracked.agreement >= max(_TRACKED_SHARE, previous.agreement - _JUMP_SHARE):
        return tracked
    likeliest = pairs.likeliest_curves()
    found = pairs.refine(likeliest, likeliest, _OUTLIERS_OF_SEARCH)
    return found if previous is None or found.agreement > tracked.agreement + _BETTER_SHARE else tracked


class _Pairs:
    """Levels of the same pixels in the background and in a frame, `(3, N)`."""

    def __init__(self, old: Image, new: Floats, usable: npt.NDArray[np.bool_]) -> None:
        self._old, self._new, self._usable = old, new, usable.astype(np.float64)
        self._count = np.maximum(self._usable.sum(axis=1), 1.0)
        knot = old // np.uint8(_SPACING)
        self._share = (old - knot * np.uint8(_SPACING)) / _SPACING
        self._knot = knot + np.arange(_CHANNELS)[:, None] * len(_KNOTS)
        size = len(_KNOTS)
        bend = np.diff(np.eye(size), n=2, axis=0)
        self._prior = _PREVIOUS_PIXELS * np.eye(size) + _STRAIGHT_PIXELS * bend.T @ bend

    def refine(self, levels: Floats, prior: Floats, outliers: tuple[float, ...]) -> ToneCurves:
        """Return the curves after a step of reweighted least squares with each limit for outliers."""
        for outlier in outliers:
            expected = self._at(levels)
            weight = self._usable * np.maximum(1.0 - ((self._new - expected) / outlier) ** 2, 0.0) ** 2
            # A clipped pixel does not tell how far above the largest level the curve is.
            weight[(self._new > _MAX_LEVEL) & (expected > self._new)] = 0.0
            levels = self._solve(weight, prior)
        deviation = np.abs(self._new - np.minimum(self._at(levels), _LEVELS - 1.0))
        agree = self._usable * (deviation < _OUTLIER)
        inside = deviation[agree > 0]
        noise = 1.48 * float(np.median(inside)) if inside.size else 0.0
        return ToneCurves(levels, noise, float(np.mean(agree.sum(axis=1) / self._count)))

    def likeliest_curves(self) -> Floats:
        """Return the monotone curves that most pairs follow, by dynamic programming over their histogram."""
        old = (self._old // _PATH_OLD).astype(np.int64)
        new = np.minimum(self._new, _LEVELS - 1.0).astype(np.int64) // _PATH_NEW
        rows, columns = _LEVELS // _PATH_OLD, _LEVELS // _PATH_NEW
        step = np.arange(columns)[None, :] - np.arange(columns)[:, None]
        bend = step * (_PATH_NEW / _PATH_OLD) - 1.0
        penalty = np.where(step >= 0, _PATH_PENALTY * bend**2, np.inf)
        curves = []
        for channel in range(_CHANNELS):
            place = old[channel] * columns + new[channel]
            counts = np.bincount(place, self._usable[channel], minlength=rows * columns)
            scores = cv2.filter2D(
                counts.reshape(rows, columns), -1, _PATH_KERNEL, borderType=cv2.BORDER_CONSTANT
            )
            curves.append(_best_path(np.asarray(scores, dtype=np.float64), penalty))
        centers = (np.arange(rows) + 0.5) * _PATH_OLD
        begin, end = _KNOTS[0], _KNOTS[-1]
        levels = []
        for path in curves:
            at = np.concatenate([[begin], centers, [end]])
            values = (path + 0.5) * _PATH_NEW
            first, last = 1.5 * values[0] - 0.5 * values[1], 1.5 * values[-1] - 0.5 * values[-2]
            levels.append(np.interp(_KNOTS, at, np.concatenate([[first], values, [last]])))
        return np.stack(levels)

    def _at(self, levels: Floats) -> Floats:
        """Return the levels that curves expect of each pixel in the frame."""
        flat = levels.ravel()
        below = flat[self._knot]
        return np.asarray(below + (flat[self._knot + 1] - below) * self._share)

    def _solve(self, weight: Floats, prior: Floats) -> Floats:
        """Return the curves of least weighted squares; they are drawn towards those of `prior`."""
        size = len(_KNOTS)
        below, above = weight * (1.0 - self._share), weight * self._share
        sums = [
            np.bincount(self._knot.ravel(), values.ravel(), minlength=_CHANNELS * size).reshape(-1, size)
            for values in (
                below * (1.0 - self._share),
                above * self._share,
                below * self._share,
                below * self._new,
                above * self._new,
            )
        ]
        matrix = np.tile(self._prior, (_CHANNELS, 1, 1))
        knots = np.arange(size)
        matrix[:, knots, knots] += sums[0]
        matrix[:, knots[1:], knots[1:]] += sums[1][:, :-1]
        matrix[:, knots[:-1], knots[1:]] += sums[2][:, :-1]
        matrix[:, knots[1:], knots[:-1]] += sums[2][:, :-1]
        moment = _PREVIOUS_PIXELS * prior + sums[3]
        moment[:, 1:] += sums[4][:, :-1]
        return np.asarray(np.linalg.solve(matrix, moment[..., None])[..., 0])


def _best_path(scores: Floats, penalty: Floats) -> Floats:
    """Return the column in each row of scores `(R, C)` of the best path; a step costs a penalty `(C, C)`."""
    best, origins = scores[0], []
    for row in scores[1:]:
        reached = best[:, None] - penalty
        origin = np.argmax(reached, axis=0)
        origins.append(origin)
        best = row + reached[origin, np.arange(len(row))]
    path = [int(np.argmax(best))]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return np.array(path[::-1], dtype=np.float64)
