"""Color histograms of the upper and lower body: brightness and two chroma shares each.

A row consists of six histograms: brightness, red share and blue share of the upper half of a box, then of its
lower half. Each has a sixth of the row's mass, so that measures on rows (Bhattacharyya, intersection, earth
mover's distance between cumulative rows) are the means of the same measures on the six. The paper's 64 gray
bins barely separate a red sweater from a green one, and not at all across cameras.
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
# Chroma shares lie around a third; values beyond these limits are clipped.
_MIN_SHARE, _MAX_SHARE = 0.15, 0.6
# Added to each channel, in gray levels, since the chroma of a dark pixel is mostly noise.
_DARK = 12.0
# Smoothing over neighboring bins, for robustness to small changes of light.
_SMOOTH = np.array([0.25, 0.5, 0.25])
# Least pixels of a half; with fewer its histograms are flat.
_MIN_PIXELS = 12


@dataclass(frozen=True, slots=True)
class AppearanceSettings:
    """Settings of the appearance histograms.

    Raises:
        ValueError: `color_bins` is out of range.
    """

    color: bool = True  # false: gray histograms of `bins` bins over the whole box (the paper)
    color_bins: int = 16  # bins of each of the six color histograms, at most 85

    def __post_init__(self) -> None:
        if not 1 <= self.color_bins <= _LEVELS // _CHANNELS:
            raise ValueError(f"color_bins must be 1 to {_LEVELS // _CHANNELS}, not {self.color_bins}")

    @property
    def color_length(self) -> int:
        """The length of a row of color histograms, also if `color` is off."""
        return len(_HALVES) * _CHANNELS * self.color_bins


@dataclass(frozen=True, slots=True)
class AppearanceExtractor:
    """Computes the appearance histograms of boxes: color, or the paper's gray ones."""

    settings: AppearanceSettings = field(default_factory=AppearanceSettings)
    gray_bins: int = 64  # bins of the gray histograms

    @property
    def bins(self) -> int:
        """The length of a row."""
        return self.settings.color_length if self.settings.color else self.gray_bins

    def histograms(self, image: Image, boxes: Floats, mask: Mask | None = None) -> Floats:
        """Return the histogram of each box `(K, 4)` of an image `(H, W, 3)`: `(K, bins)`, rows sum to 1.

        Pixels where `mask` `(H, W)` is 0 are left out.
        """
        if self.settings.color:
            return color_histograms(image, boxes, self.settings.color_bins, mask)
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return gray_histograms(gray, boxes, self.gray_bins, mask)


def color_histograms(
    image: Image, boxes: Floats, bins_per_histogram: int, mask: Mask | None = None
) -> Floats:
    """Return the six histograms of each box, `(K, 6 bins_per_histogram)`, rows sum to 1.

    Args:
        image: `(H, W, 3)`.
        boxes: `(K, 4)` in pixels of the image.
        bins_per_histogram: brightness, red share and blue share of the upper, then the lower half.
        mask: `(H, W)`, pixels where it is 0 are left out; None: all pixels count.
    """
    if mask is None:
        mask = np.full(image.shape[:2], 255, dtype=np.uint8)
    codes = _coded(image, bins_per_histogram, mask)
    counts = np.zeros((len(boxes), len(_HALVES), _CHANNELS * bins_per_histogram))
    limits = np.array([image.shape[1], image.shape[0]] * 2, dtype=np.float64)
    for k, box in enumerate(np.clip(boxes, 0.0, limits)):
        height = box[3] - box[1]
        columns = slice(round(box[0]), round(box[2]))
        for half, (begin, end) in enumerate(_HALVES):
            lines = slice(round(box[1] + begin * height), round(box[1] + end * height))
            if cv2.countNonZero(mask[lines, columns]) >= _MIN_PIXELS:
                counts[k, half] = _count(codes[lines, columns], mask[lines, columns])[: counts.shape[2]]
    return _rows(counts.reshape(len(boxes), len(_HALVES) * _CHANNELS, bins_per_histogram))


def _count(codes: npt.NDArray[np.uint8], mask: Mask) -> Floats:
    """Return how often each code occurs in any channel inside a mask, `(256,)`."""
    counts = np.zeros((_LEVELS, 1))
    for channel in range(_CHANNELS):
        counts += cv2.calcHist([codes], [channel], mask, [_LEVELS], [0, _LEVELS])
    return counts[:, 0]


def _rows(counts: Floats) -> Floats:
    """Convert counts `(K, 6, bins)` to rows; a histogram without pixels is flat."""
    boxes, histograms, bins = counts.shape
    smooth = _SMOOTH[1] * counts
    smooth[..., 1:] += _SMOOTH[0] * counts[..., :-1]
    smooth[..., :-1] += _SMOOTH[2] * counts[..., 1:]
    # The mass at the ends is not smoothed away.
    smooth[..., 0] += _SMOOTH[0] * counts[..., 0]
    smooth[..., -1] += _SMOOTH[2] * counts[..., -1]
    total = counts.sum(axis=-1, keepdims=True)
    shares = np.where(total > 0.0, smooth / np.maximum(total, 1.0), 1.0 / bins)
    return np.asarray(shares.reshape(boxes, histograms * bins) / histograms)


def _coded(image: Image, bins: int, mask: Mask) -> npt.NDArray[np.uint8]:
    """Return each pixel's bins of brightness (its square root), red and blue share, `(H, W, 3)`.

    Those of the second channel start at `bins`, of the third at `2 bins`, so that one count covers all.
    Pixels outside the mask are 0.
    """
    where = np.flatnonzero(mask)
    codes = np.zeros(image.shape, dtype=np.uint8)
    if where.size:
        codes.reshape(-1, _CHANNELS)[where] = _codes_of(
            image.reshape(-1, _CHANNELS).take(where, axis=0), bins
        )
    return codes


def _codes_of(pixels: npt.NDArray[np.uint8], bins: int) -> npt.NDArray[np.uint8]:
    """Return the bins of pixels `(N, 3)`."""
    blue, green, red = (plane.astype(np.float32) + np.float32(_DARK) for plane in pixels.T)
    per_total = np.float32(bins / (_MAX_SHARE - _MIN_SHARE)) / (blue + green + red)
    first = np.float32(bins * _MIN_SHARE / (_MAX_SHARE - _MIN_SHARE))
    roots = np.sqrt(np.arange(_LEVELS) / (_LEVELS - 1.0))
    table = np.minimum(roots * bins, bins - 1).astype(np.uint8)
    codes = np.empty_like(pixels)
    codes[:, 0] = table[cv2.cvtColor(pixels[:, None], cv2.COLOR_BGR2GRAY)[:, 0]]
    for channel, plane in enumerate((red, blue), 1):
        codes[:, channel] = np.clip(plane * per_total - first, 0, bins - 1) + np.float32(channel * bins)
    return codes
