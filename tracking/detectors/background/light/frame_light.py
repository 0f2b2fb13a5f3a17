"""How a frame's light differs from the background's: exposure, haze, and light on parts of the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from tracking.detectors.background.light.haze import Haze, find_haze
from tracking.detectors.background.light.local_light import (
    find_local_light,
    reduce_to_cells,
    relight,
    unlight,
)
from tracking.detectors.background.light.tone_curve import ToneCurves, fit_tone_curves
from tracking.detectors.base import Image, Mask, Plane


@dataclass(frozen=True, slots=True, eq=False)
class FrameLight:
    """The light of one frame.

    Attributes:
        curves: the exposure, from the background's levels to the frame's.
        haze: what the curves do not explain by rows; None: nothing.
        gain: `(H, W, 3)`, the local light's; None: there is none.
        noise: what is not explained of the pixels without people, as a standard deviation in gray levels.
    """

    curves: ToneCurves
    haze: Haze | None = None
    gain: Plane | None = None
    noise: float = 0.0

    def apply(self, background: Image) -> Image:
        """Return a background as the frame shows it outside of the local light."""
        expected = self.curves.apply(background)
        return expected if self.haze is None else self.haze.apply(expected)

    def contrast_of(self, background_cells: Image) -> float | Plane:
        """Return the contrast of a background in the frame over its own, in all or by row of cells `(h,)`."""
        contrast = self.curves.contrast_of(background_cells)
        return contrast if self.haze is None else np.asarray(contrast * self.haze.gain, dtype=np.float32)

    def apply_local(self, expected: Image) -> Image | None:
        """Return what `apply` returned as the frame shows it in the local light; None: there is none."""
        return None if self.gain is None else relight(expected, self.gain)

    def remove(self, image: Image, background: Image | None = None) -> Image:
        """Return a frame, of any size, at the background's light; see `ToneCurves.invert`."""
        unlit = image
        if self.gain is not None:
            size = (image.shape[1], image.shape[0])
            gain = self.gain if self.gain.shape == image.shape else cv2.resize(self.gain, size)
            unlit = unlight(image, np.asarray(gain, dtype=np.float32))
        unlit = unlit if self.haze is None else self.haze.remove(unlit)
        return self.curves.invert(unlit, background)


def fit_frame_light(
    image: Image,
    background: Image,
    background_cells: Image,
    unlikely: Mask | None = None,
    before: FrameLight | None = None,
    *,
    looks_for_haze: bool = True,
) -> FrameLight:
    """Return the light of a frame, both `(H, W, 3)`.

    What is left of the last frame's light in a part of the picture is local light; it is taken away before
    the curves are fitted, which would follow it otherwise.

    Args:
        image: the frame, where the background is.
        background: what it shows without people, at the background's light.
        background_cells: the same, reduced to cells.
        unlikely: `(H, W)`, not 0 where people are likely.
        before: the light of the frame before.
        looks_for_haze: fit the haze; it comes slowly, otherwise it is that of the frame before.
    """
    cells = reduce_to_cells(image)
    haze = None if before is None else before.haze
    curves = fit_tone_curves(image, background) if before is None else before.curves
    light = find_local_light(cells, FrameLight(curves, haze), background_cells)
    if light is not None and (sign := light.exposure_sign):
        rest, outside = light.without(sign), light.outside(sign, image.shape)
        unlit = unlight(image, rest.gain(image.shape)) if rest.sign.any() else image
        curves = fit_tone_curves(unlit, background, outside)
        light = find_local_light(cells, FrameLight(curves, haze), background_cells)
    gain = None if light is None else light.gain(image.shape)
    unlit = image if gain is None else unlight(image, gain)
    curves = fit_tone_curves(unlit, background, unlikely, curves)
    if looks_for_haze:
        unlit_cells = cells if gain is None else reduce_to_cells(unlit)
        haze = find_haze(unlit_cells, curves.apply(background_cells))
    found = FrameLight(curves, haze, gain, curves.noise)
    return found if haze is None else replace(found, noise=_noise(unlit, found.apply(background)))


# Pixels between two that enter the noise; deviation, in gray levels, beyond which a pixel shows a person.
_STEP, _OUTLIER = 7, 14


def _noise(image: Image, expected: Image) -> float:
    deviation = cv2.absdiff(image[::_STEP, ::_STEP], expected[::_STEP, ::_STEP])
    inside = deviation[deviation < _OUTLIER]
    return 1.48 * float(np.median(inside)) if inside.size else 0.0
