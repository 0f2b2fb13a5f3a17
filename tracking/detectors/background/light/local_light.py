"""Local light: sun over a part of the picture, a lamp, the shadow of a cloud.

Light multiplies the levels of all that it falls on: the ratio of a frame to the expected background is smooth
over a region larger than people, and jumps at people's outlines. Such regions get a gain of their own.
Each pixel may be in either state, with the light or without it: the edge of the light need not be known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane

# Pixels of the working image per cell, on each axis.
_CELL = 4
# Added to levels, since ratios of dark pixels are noise.
_DARK = 10.0
_LOGARITHMS = np.log(np.arange(256) + _DARK).astype(np.float32)
# Least and largest logarithm of the ratio: less is no light, more no light that a camera shows.
_MIN_LIGHT, _MAX_LIGHT = 0.07, 1.0
# Largest deviation of a cell from its neighbors, and of its channels from each other.
_MAX_ROUGHNESS, _MAX_CHROMA = 0.06, 0.25
# Side of a square that a region has to contain, in picture heights (people are narrower), and how much of it.
_SIDE, _FILLED = 0.22, 0.85
# Window, in picture heights, over which the gain of a region is continued to people in it and to its edge.
_REACH, _LEAST_SUPPORT = 0.12, 0.02


# Share of the cells that must deviate at all before regions are sought.
_MIN_SHARE = 0.05


class GlobalLight(Protocol):
    """The light of a frame apart from local light."""

    def apply(self, background: Image) -> Image:
        """Return a background as the frame shows it."""
        ...

    def remove(self, image: Image) -> Image:
        """Return a frame at the background's light."""
        ...


def reduce_to_cells(image: Image) -> Image:
    """Return the means of an image `(H, W, 3)` over cells, `(h, w, 3)`."""
    size = (image.shape[1] // _CELL, image.shape[0] // _CELL)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class LocalLight:
    """The light of a frame over that of the background, beyond the tone curves.

    Attributes:
        ratios: `(h, w, 3)`, the logarithm of the frame over the expected background in each cell.
        sign: `(h, w)`, 1 in regions that are brighter, -1 in darker ones, 0 elsewhere.
        unlit_share: the share of the picture that is smooth and neither.
    """

    ratios: Plane
    sign: npt.NDArray[np.int8]
    unlit_share: float

    @property
    def exposure_sign(self) -> int:
        """The sign of regions that cover most of the picture: that is the exposure; 0: there are none."""
        shares = {sign: float(np.mean(self.sign == sign)) for sign in (1, -1)}
        sign = max(shares, key=lambda each: shares[each])
        return sign if shares[sign] > max(_MOSTLY * self.unlit_share, _MIN_EXPOSED) else 0

    def without(self, sign: int) -> LocalLight:
        """Return the light without the regions of a sign."""
        return LocalLight(self.ratios, np.where(self.sign == sign, 0, self.sign).astype(np.int8), 1.0)

    def outside(self, sign: int, shape: tuple[int, ...]) -> Mask:
        """Return a mask `(H, W)` of 255 outside of the regions of a sign."""
        outside = np.where(self.sign == sign, 0, 255).astype(np.uint8)
        size = (shape[1], shape[0])
        return np.asarray(cv2.resize(outside, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)

    def gain(self, shape: tuple[int, ...]) -> Plane:
        """Return the gain of each pixel, `(H, W, 3)`: 1 where there is no such light.

        It is continued to people in the light, and a little beyond its edge.
        """
        lit = (self.sign != 0).astype(np.float32)
        wide = max(round(_REACH * lit.shape[0]), 1) * 2 + 1
        around, near = _mean_of(self.ratios, lit, wide)
        own, _ = _mean_of(self.ratios, lit, 3)
        logarithms = np.where(lit[..., None] > 0, own, np.where((near > 0)[..., None], around, 0.0))
        gains = np.exp(logarithms).astype(np.float32)
        return np.asarray(cv2.resize(gains, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR))


# A sign is the exposure's from this multiple of the unlit share of the picture, and from this share of it.
_MOSTLY, _MIN_EXPOSED = 1.5, 0.25


def find_local_light(cells: Image, light_of_frame: GlobalLight, background: Image) -> LocalLight | None:
    """Return the local light of a frame; None: there is none.

    Args:
        cells: `(h, w, 3)`, the frame's cells.
        light_of_frame: the frame's light apart from the local light.
        background: `(h, w, 3)`, the background's cells.
    """
    ratios = _ratios(cells, light_of_frame.apply(background))
    light = np.ascontiguousarray(ratios.mean(axis=2))
    strong = np.abs(light) >= _MIN_LIGHT
    if np.count_nonzero(strong) < _MIN_SHARE * strong.size:
        return None
    chroma = ratios.max(axis=2) - ratios.min(axis=2)
    smooth = (chroma <= _MAX_CHROMA) & (np.abs(light - cv2.medianBlur(light, 5)) <= _MAX_ROUGHNESS)
    # In fog dark clothing is hardly darker than the ground: it is told apart at the background's contrast.
    contrasted = _ratios(light_of_frame.remove(cells), background).mean(axis=2)
    candidates = smooth & strong & (np.abs(light) <= _MAX_LIGHT) & (np.abs(contrasted) <= _MAX_LIGHT)
    side = max(round(_SIDE * light.shape[0]), 3)
    sign = np.zeros(light.shape, dtype=np.int8)
    for each in (1, -1):
        region = (candidates & (each * light > 0)).astype(np.uint8)
        filled = cv2.boxFilter(region, cv2.CV_32F, (side, side), borderType=cv2.BORDER_CONSTANT) >= _FILLED
        if filled.any():
            sign[_components_with(filled, region)] = each
    return LocalLight(ratios, sign, float(np.mean(smooth & ~strong))) if sign.any() else None


def _ratios(cells: Image, expected: Image) -> Plane:
    """Return the logarithms of ratios of levels."""
    return np.asarray(_LOGARITHMS[cells] - _LOGARITHMS[expected])


def _components_with(cores: npt.NDArray[np.bool_], region: Mask) -> npt.NDArray[np.bool_]:
    """Return the connected parts of a region that have a core."""
    count, labels = cv2.connectedComponents(region, connectivity=4)
    chosen = np.zeros(count, dtype=np.bool_)
    chosen[np.unique(labels[cores])] = True
    chosen[0] = False
    return np.asarray(chosen[labels])


def _mean_of(values: Plane, weight: Plane, window: int) -> tuple[Plane, Plane]:
    """Return the weighted means of values `(h, w, 3)` over a square window, and the mean weight."""
    size = (window, window)
    total = cv2.blur(weight, size, borderType=cv2.BORDER_CONSTANT)
    means = cv2.blur(values * weight[..., None], size, borderType=cv2.BORDER_CONSTANT)
    total = np.where(total < _LEAST_SUPPORT, 0.0, total)
    means = means / np.maximum(total, _LEAST_SUPPORT)[..., None]
    return np.asarray(means, dtype=np.float32), np.asarray(total, dtype=np.float32)


def relight(expected: Image, gain: Plane) -> Image:
    """Return the expected background `(H, W, 3)` in a local light."""
    return np.asarray(cv2.multiply(expected, gain, dtype=cv2.CV_8U), dtype=np.uint8)


def unlight(image: Image, gain: Plane) -> Image:
    """Return a frame `(H, W, 3)` without a local light."""
    return np.asarray(cv2.divide(image, gain, dtype=cv2.CV_8U), dtype=np.uint8)
