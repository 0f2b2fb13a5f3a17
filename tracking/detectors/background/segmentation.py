"""Foreground and shadow masks. A shadow is darker than the floor, but of the floor's color.

Gray clothing has the same appearance, so pixels that look like a shadow count neither for a person nor
against.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.base import Image, Mask, Plane


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """Pixels by kind, each `(H, W)`, 0 or 255; the other pixels are background.

    Attributes:
        foreground: pixels that differ clearly from the background.
        shadow: pixels that look like a shadow: shadows, or gray clothing.
        image: `(H, W, 3)`, the frame where the background is, and at its light.
        motion: where the background is in the frame.
    """

    foreground: Mask
    shadow: Mask
    image: Image
    motion: Motion = STILL

    def without(self, unknown: Mask) -> Segmentation:
        """Return the segmentation with foreground in an area as shadow: neither for a person nor against."""
        shadow = self.shadow | (self.foreground & unknown)
        return replace(self, foreground=self.foreground & ~unknown, shadow=shadow)


def largest_difference(image: Image, expected: Image) -> Mask:
    """Return the largest difference of the channels, `(H, W)`."""
    blue, green, red = cv2.split(cv2.absdiff(image, expected))
    return np.asarray(cv2.max(cv2.max(blue, green), red), dtype=np.uint8)


def exceeding(difference: Mask, thresholds: Plane) -> Mask:
    """Return where a difference `(H, W)` is above a threshold, `()` or `(h,)` for as many bands of rows."""
    if not thresholds.ndim:
        return np.asarray(
            cv2.threshold(difference, float(thresholds), 255, cv2.THRESH_BINARY)[1], dtype=np.uint8
        )
    rows = np.arange(len(difference)) * len(thresholds) // len(difference)
    return np.asarray(np.where(difference > thresholds[rows][:, None], 255, 0), dtype=np.uint8)


def smoothed(image: Image) -> Image:
    """Return an image with a third of its noise."""
    return np.asarray(cv2.GaussianBlur(image, (5, 5), 0.0), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class ShadowSettings:
    """Thresholds for shadows on the ratio of frame to background in each channel."""

    enabled: bool = True
    min_ratio: float = 0.6  # least mean ratio: darker is clothing
    max_ratio: float = 0.97  # largest mean ratio: lighter is no shadow
    max_chroma_spread: float = 0.03  # largest spread of the ratio over the channels, in shares of their mean


def shadow_mask(image: Image, background: Image, foreground: Mask, settings: ShadowSettings) -> Mask:
    """Return the part of the foreground `(H, W)` that looks like a shadow.

    Args:
        image: `(H, W, 3)`.
        background: `(H, W, 3)` at the gain of the image.
        foreground: `(H, W)`, 255 where the two differ.
        settings: the thresholds.
    """
    shadow = np.zeros_like(foreground)
    where = np.flatnonzero(foreground)
    if not settings.enabled or not where.size:
        return shadow
    new = image.reshape(-1, 3)[where].astype(np.float32) + 1.0
    old = background.reshape(-1, 3)[where].astype(np.float32) + 1.0
    ratio = new / old
    blue, green, red = ratio.T  # separately: three times as fast as sums over the short axis
    mean = (blue + green + red) / np.float32(3.0)
    spread = np.maximum(np.maximum(blue, green), red) - np.minimum(np.minimum(blue, green), red)
    darker = (mean >= settings.min_ratio) & (mean <= settings.max_ratio)
    shadow.ravel()[where[darker & (spread <= settings.max_chroma_spread * mean)]] = 255
    return shadow


# Closing connects a head to its shoulders if the hair has the background's color.
_CLOSE = np.ones((5, 3), dtype=np.uint8)
# Margin around a box, in its sides, where the background is not updated: shadows, hands, inexact boxes.
_OCCUPIED_MARGIN = 0.15


def clean_mask(mask: Mask) -> Mask:
    """Remove isolated pixels and close small holes."""
    return np.asarray(cv2.morphologyEx(cv2.medianBlur(mask, 5), cv2.MORPH_CLOSE, _CLOSE), dtype=np.uint8)


def occupied_mask(boxes: npt.NDArray[np.float64], shape: tuple[int, ...]) -> Mask:
    """Return a mask of `shape` that is 255 in and around the boxes."""
    occupied = np.zeros(shape, dtype=np.uint8)
    for left, top, right, bottom in boxes:
        x, y = _OCCUPIED_MARGIN * (right - left), _OCCUPIED_MARGIN * (bottom - top)
        rows = slice(max(int(top - y), 0), int(bottom + y) + 1)
        occupied[rows, max(int(left - x), 0) : int(right + x) + 1] = 255
    return occupied
