"""Color histograms of the upper and lower body: brightness and two chroma shares each.

Six histograms beside each other in one row: brightness, red share and blue share of the upper half of a
box, then of its lower half. Every one of the six holds a sixth of the row's mass, so that measures on
rows (Bhattacharyya, intersection, earth mover's distance between cumulative rows) are the means of the
same measures on the six. Gray alone, the paper's 64 bins, tells a red jumper from a green one badly, and
not at all from another camera.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from tracking.appearance import gray_histograms
from tracking.boxes import Floats
from tracking.detectors.base import Image, Mask

_LEVELS = 256
_CHANNELS = 3
_HALVES = ((0.05, 0.5), (0.5, 1.0))
# Chroma shares lie around a third; beyond these shares everything is one color.
_LEAST_SHARE, _MOST_SHARE = 0.15, 0.6
# Added to each channel, in gray levels: the chroma of a dark pixel is mostly noise.
_DARK = 12.0
# Neighbouring bins share, so that a little more light does not make another person.
_SMOOTH = np.array([0.25, 0.5, 0.25])
# Pixels that a half needs to look like anything.
_LEAST_PIXELS = 12


@dataclass(frozen=True, slots=True)
class AppearanceSettings:
    """The appearance of the hypotheses.

    Raises:
        ValueError: so many bins do not fit.
    """

    color: bool = True  # false: gray histograms of `bins` bins over the whole box (the paper)
    color_bins: int = 16  # bins of each of the six color histograms, at most 85

    def __post_init__(self) -> None:
        if not 1 <= self.color_bins <= _LEVELS // _CHANNELS:
            raise ValueError(f"color_bins must be 1 to {_LEVELS // _CHANNELS}, not {self.color_bins}")

    @property
    def length(self) -> int:
        """The length of a row of color histograms."""
        return len(_HALVES) * _CHANNELS * self.color_bins


@dataclass(frozen=True, slots=True)
class AppearanceExtractor:
    """Computes the appearance histograms of boxes: color, or the paper's gray ones."""

    settings: AppearanceSettings = field(default_factory=AppearanceSettings)
    gray_bins: int = 64  # bins of the gray histograms

    @property
    def bins(self) -> int:
        """The length of a row."""
        return self.settings.length if self.settings.color else self.gray_bins

    def histograms(self, image: Image, boxes: Floats, mask: Mask | None = None) -> Floats:
        """Return the histogram of each box `(K, 4)` of an image `(H, W, 3)`: `(K, bins)`, rows sum to 1.

        Only the pixels count at which `mask` `(H, W)`, where there is one, is not 0.
        """
        if self.settings.color:
            return color_histograms(image, boxes, self.settings.color_bins, mask)
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return gray_histograms(gray, boxes, self.gray_bins, mask)


def color_histograms(image: Image, boxes: Floats, bins: int, mask: Mask | None = None) -> Floats:
    """Return the six histograms of each box, `(K, 6 bins)`, rows sum to 1.

    Args:
        image: `(H, W, 3)`.
        boxes: `(K, 4)` in pixels of the image.
        bins: of each histogram.
        mask: `(H, W)`, only its pixels that are not 0 count; none: all do.
    """
    if mask is None:
        mask = np.full(image.shape[:2], 255, dtype=np.uint8)
    codes = _coded(image, bins, mask)
    counts = np.zeros((len(boxes), len(_HALVES), _CHANNELS * bins))
    limits = np.array([image.shape[1], image.shape[0]] * 2, dtype=np.float64)
    for k, box in enumerate(np.clip(boxes, 0.0, limits)):
        tall = box[3] - box[1]
        columns = slice(round(box[0]), round(box[2]))
        for half, (begin, end) in enumerate(_HALVES):
            lines = slice(round(box[1] + begin * tall), round(box[1] + end * tall))
            seen = codes[lines, columns][mask[lines, columns] != 0]
            if len(seen) >= _LEAST_PIXELS:
                counts[k, half] = np.bincount(seen.ravel(), minlength=_CHANNELS * bins)
    return _rows(counts.reshape(len(boxes), len(_HALVES) * _CHANNELS, bins))


def _rows(counts: Floats) -> Floats:
    """Turn counts `(K, 6, bins)` into rows; a histogram without a pixel is flat."""
    boxes, histograms, bins = counts.shape
    smooth = _SMOOTH[1] * counts
    smooth[..., 1:] += _SMOOTH[0] * counts[..., :-1]
    smooth[..., :-1] += _SMOOTH[2] * counts[..., 1:]
    # At the ends the mass stays.
    smooth[..., 0] += _SMOOTH[0] * counts[..., 0]
    smooth[..., -1] += _SMOOTH[2] * counts[..., -1]
    total = counts.sum(axis=-1, keepdims=True)
    shares = np.where(total > 0.0, smooth / np.maximum(total, 1.0), 1.0 / bins)
    return np.asarray(shares.reshape(boxes, histograms * bins) / histograms)


def _coded(image: Image, bins: int, mask: Mask) -> npt.NDArray[np.uint8]:
    """Return each pixel's bins of brightness (its square root), red and blue share, `(H, W, 3)`.

    Those of the second channel begin at `bins`, of the third at `2 bins`, so that one count does for all.
    Only pixels of the mask are looked at; the others are 0.
    """
    where = np.flatnonzero(mask)
    codes = np.zeros(image.shape, dtype=np.uint8)
    if where.size:
        codes.reshape(-1, _CHANNELS)[where] = _codes_of(image.reshape(-1, _CHANNELS)[where], bins)
    return codes


def _codes_of(pixels: npt.NDArray[np.uint8], bins: int) -> npt.NDArray[np.uint8]:
    """Return the bins of pixels `(N, 3)`."""
    blue, green, red = (plane.astype(np.float32) + np.float32(_DARK) for plane in pixels.T)
    per_total = np.float32(bins / (_MOST_SHARE - _LEAST_SHARE)) / (blue + green + red)
    first = np.float32(bins * _LEAST_SHARE / (_MOST_SHARE - _LEAST_SHARE))
    roots = np.sqrt(np.arange(_LEVELS) / (_LEVELS - 1.0))
    table = np.minimum(roots * bins, bins - 1).astype(np.uint8)
    codes = np.empty_like(pixels)
    codes[:, 0] = table[cv2.cvtColor(pixels[:, None], cv2.COLOR_BGR2GRAY)[:, 0]]
    for channel, plane in enumerate((red, blue), 1):
        codes[:, channel] = np.clip(plane * per_total - first, 0, bins - 1) + np.float32(channel * bins)
    return codes
