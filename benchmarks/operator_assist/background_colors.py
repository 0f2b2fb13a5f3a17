"""Which colors are those of what moves: learned from pictures, without anybody who marks them.

A weed that sways, a net of light on the sand and a fish all differ from a still background. But the colors
of the weed are mostly seen where nothing differs, and those of the fish only where something does. So a
color's share of foreground tells them apart, as histograms of skin tell hands from walls (Jones & Rehg, IJCV
2002), and it tells as much of who is pale in the murk as of who is near: pale colors are learned, too.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane

_LIGHT, _CHROMA = 16, 32
"""Bins of lightness, and of each of the two opponent colors of CIELAB."""
_PER_LIGHT, _PER_CHROMA = 16, 4
"""Levels of a bin: beyond half of the chroma's range nothing natural is left."""
_MIDDLE = 128
_NEVER_SEEN = 0.5
"""Pixels of foreground, and of background, that every color is taken to have had before."""
_AROUND = np.ones((5, 5), dtype=np.uint8)
"""Pixels around the foreground that belong to neither: its edges are of mixed colors."""


class ForegroundColors:
    """How often each color was foreground where it was seen."""

    def __init__(self, seen: Iterable[tuple[Image, Mask]]) -> None:
        """Learn from pictures, each with its foreground `(H, W)`, 255 where something differs.

        There may be much in the foreground that does not belong there, as long as most of what looks like
        that is in the background.
        """
        bins = _LIGHT * _CHROMA * _CHROMA
        moving, still = np.zeros(bins), np.zeros(bins)
        for image, mask in seen:
            codes = _codes(image)
            inside, outside = mask > 0, cv2.dilate(mask, _AROUND) == 0
            moving += np.bincount(codes[inside], minlength=bins)
            still += np.bincount(codes[outside], minlength=bins)
        moving, still = _smooth(moving), _smooth(still)
        self._shares = ((moving + _NEVER_SEEN) / (moving + still + 2 * _NEVER_SEEN)).astype(np.float32)

    def shares(self, image: Image) -> Plane:
        """Return how often each pixel's color was foreground, `(H, W)` in [0, 1]; unknown colors ½."""
        return np.asarray(self._shares[_codes(image)])


def _codes(image: Image) -> npt.NDArray[np.int32]:
    """Return every pixel's bin, `(H, W)`."""
    lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), dtype=np.int32)
    chroma = np.clip((lab[..., 1:] - _MIDDLE) // _PER_CHROMA + _CHROMA // 2, 0, _CHROMA - 1)
    codes = (lab[..., 0] // _PER_LIGHT * _CHROMA + chroma[..., 0]) * _CHROMA + chroma[..., 1]
    return np.asarray(codes, dtype=np.int32)


def _smooth(counts: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Let neighboring chromas share what was counted: of a few pictures most bins are empty."""
    planes = counts.reshape(_LIGHT, _CHROMA, _CHROMA)
    return np.concatenate([cv2.blur(plane, (3, 3)).ravel() for plane in planes])
