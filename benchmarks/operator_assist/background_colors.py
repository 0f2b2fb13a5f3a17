"""A color model of moving objects, learned from unlabeled pictures.

A swaying weed, caustics on the sand and a fish all differ from a static background. But the colors of the
weed are mostly seen in the background, and those of the fish only in the foreground. So the foreground share
of a color separates them, as skin histograms separate hands from walls (Jones & Rehg, IJCV 2002); it also
works for objects that are pale in murky water, whose colors are learned, too.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane

_LIGHT, _CHROMA = 16, 32
"""Bins of lightness, and of each chroma axis of CIELAB."""
_PER_LIGHT, _PER_CHROMA = 16, 4
"""Levels per bin; half of the chroma's range covers all natural colors."""
_MIDDLE = 128
_NEVER_SEEN = 0.5
"""Prior pixels of foreground, and of background, for every color."""
_AROUND = np.ones((5, 5), dtype=np.uint8)
"""Margin around the foreground that is ignored: edges have mixed colors."""


class ForegroundColors:
    """The foreground share of each color."""

    def __init__(self, pictures: Iterable[tuple[Image, Mask]]) -> None:
        """Learn from pictures, each with its foreground `(H, W)`, 255 or 0.

        The foreground may contain false positives, as long as their colors are mostly seen in the background.
        """
        bins = _LIGHT * _CHROMA * _CHROMA
        moving, still = np.zeros(bins), np.zeros(bins)
        for image, mask in pictures:
            codes = _codes(image)
            inside, outside = mask > 0, cv2.dilate(mask, _AROUND) == 0
            moving += np.bincount(codes[inside], minlength=bins)
            still += np.bincount(codes[outside], minlength=bins)
        moving, still = _smooth(moving), _smooth(still)
        self._shares = ((moving + _NEVER_SEEN) / (moving + still + 2 * _NEVER_SEEN)).astype(np.float32)

    def shares(self, image: Image) -> Plane:
        """Return the foreground share of each pixel's color, `(H, W)` in [0, 1]; unknown colors ½."""
        return np.asarray(self._shares[_codes(image)])


def _codes(image: Image) -> npt.NDArray[np.int32]:
    """Return the bin of each pixel, `(H, W)`."""
    lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), dtype=np.int32)
    chroma = np.clip((lab[..., 1:] - _MIDDLE) // _PER_CHROMA + _CHROMA // 2, 0, _CHROMA - 1)
    codes = (lab[..., 0] // _PER_LIGHT * _CHROMA + chroma[..., 0]) * _CHROMA + chroma[..., 1]
    return np.asarray(codes, dtype=np.int32)


def _smooth(counts: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Smooth the counts over neighboring chromas, since a few pictures leave most bins empty."""
    planes = counts.reshape(_LIGHT, _CHROMA, _CHROMA)
    return np.concatenate([cv2.blur(plane, (3, 3)).ravel() for plane in planes])
