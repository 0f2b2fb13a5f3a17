"""Haze: contrast that is lost with distance, and so by the row of the picture.

Fog, smoke, and the glare of a low sun lay a veil over the scene, denser where it is farther away, which is
mostly higher in the picture. A row shows `gain * level + offset` (Koschmieder's law: the gain is the share of
light that arrives, the offset the light of the veil). Both are fitted to each row by reweighted least squares
over the cells of all channels, and are smooth over rows, so that people do not bend them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.detectors.base import Image, Plane

# Rows over which the fit is smooth, in picture heights, and rounds of reweighting.
_SMOOTH, _ROUNDS = 0.25, 3
# Deviation, in gray levels, beyond which a cell counts as a person.
_OUTLIER = 20.0
# Strength of the prior of no haze: pixels at this deviation from the row's mean level, in gray levels.
_PRIOR_CELLS, _PRIOR_SPREAD = 20.0, 20.0
# Least share of light that is believed, and the deviation, in gray levels, below which there is no haze.
_MIN_GAIN, _MIN_DEVIATION = 0.2, 4.0
_MID_LEVEL, _HALF = 128.0, np.float32(0.5)
_MIN_WEIGHT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Haze:
    """The haze of a frame, beyond what the tone curves explain.

    Attributes:
        gain: `(h,)`, the share of contrast left, by rows of cells.
        offset: `(h,)`, the veil's light, in gray levels.
    """

    gain: Plane
    offset: Plane

    def apply(self, image: Image) -> Image:
        """Return a background `(H, W, 3)` as it looks behind the haze."""
        gain, offset = self._at_rows(len(image))
        return np.asarray(np.clip(image * gain + offset + _HALF, 0.0, 255.0), dtype=np.uint8)

    def remove(self, image: Image) -> Image:
        """Return a frame `(H, W, 3)` as it would be without the haze."""
        gain, offset = self._at_rows(len(image))
        return np.asarray(np.clip((image - offset) / gain + _HALF, 0.0, 255.0), dtype=np.uint8)

    def _at_rows(self, rows: int) -> tuple[Plane, Plane]:
        """Return gain and offset of each row of an image, `(H, 1, 1)`."""
        count = len(self.gain)
        at, known = (np.arange(rows) + 0.5) * count / rows - 0.5, np.arange(count)
        gain, offset = (
            np.interp(at, known, each).astype(np.float32)[:, None, None] for each in (self.gain, self.offset)
        )
        return gain, offset


def find_haze(cells: Image, expected: Image) -> Haze | None:
    """Return the haze of a frame; None: there is none.

    Args:
        cells: `(h, w, 3)`, the frame's cells.
        expected: `(h, w, 3)`, the background's, as the frame should show them.
    """
    count = cells.shape[0]
    new = cells.reshape(count, -1).astype(np.float32)
    old = expected.reshape(count, -1).astype(np.float32)
    gain, offset = np.ones((count, 1), np.float32), np.zeros((count, 1), np.float32)
    for outlier in (3.0 * _OUTLIER, *[_OUTLIER] * (_ROUNDS - 1)):
        weight = np.maximum(1.0 - ((new - gain * old - offset) / outlier) ** 2, 0.0) ** 2
        gain, offset = _fit_rows(new, old, weight)
    if np.abs(gain * _MID_LEVEL + offset - _MID_LEVEL).max() < _MIN_DEVIATION:
        return None
    return Haze(gain[:, 0], offset[:, 0])


def _fit_rows(new: Plane, old: Plane, weight: Plane) -> tuple[Plane, Plane]:
    """Return gain and offset of each row, `(h, 1)`, of the least weighted squares over the rows near it."""
    window = max(round(_SMOOTH * len(new)), 1) | 1
    sums = np.stack([weight, weight * old, weight * new, weight * old * old, weight * old * new]).sum(axis=2)
    total, s_old, s_new, s_oo, s_on = (
        cv2.blur(each.astype(np.float32)[:, None], (1, window), borderType=cv2.BORDER_REPLICATE)
        for each in sums
    )
    total = np.maximum(total, 1e-3)
    mean_old, mean_new = s_old / total, s_new / total
    prior = _PRIOR_CELLS * _PRIOR_SPREAD**2
    variance = np.maximum(s_oo - total * mean_old**2, 0.0) + prior
    covariance = s_on - total * mean_old * mean_new + prior
    gain = np.clip(covariance / variance, _MIN_GAIN, 1.0 / _MIN_GAIN).astype(np.float32)
    return gain, np.asarray(mean_new - gain * mean_old, dtype=np.float32)
