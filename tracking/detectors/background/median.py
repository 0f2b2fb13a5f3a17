"""Median background model, which absorbs neither people nor their ghosts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.background.color_gain import apply_gains, gains_over_reference
from tracking.detectors.background.segmentation import Segmentation, ShadowSettings, shadow_mask
from tracking.detectors.background.static_foreground import GhostFinder, StaticForegroundSettings
from tracking.detectors.base import Image, Mask, require_at_least_one


@dataclass(frozen=True, slots=True)
class MedianSettings:
    """The gain-compensated median background.

    Raises:
        ValueError: a setting is out of range.
    """

    bootstrap_frames: int = 50  # frames whose median is the first background (2 s at 25 frames/s)
    samples: int = 15  # bootstrap frames that enter the median; odd
    threshold: float = (
        24.0  # largest difference over the channels, in gray levels, above which a pixel is foreground
    )
    learn_every: int = 5  # frames between two updates of the background
    learn_rate: float = 0.02  # share of the new frame in each update, where no person is
    relearn_share: float = 0.6  # foreground share of the image that indicates a change of light
    relearn_frames: int = 15  # consecutive such frames before the background is learned again

    def __post_init__(self) -> None:
        require_at_least_one(self, "bootstrap_frames", "samples", "learn_every")


class MedianBackground:
    """Background model of one camera: the median of the first frames, updated where no people are.

    It is usable after half of the bootstrap; the median is computed again at its end.
    """

    def __init__(
        self, settings: MedianSettings, static: StaticForegroundSettings, shadows: ShadowSettings
    ) -> None:
        self._settings = settings
        self._static_filter = GhostFinder(static)
        self._shadows = shadows
        self._samples: list[Image] = []
        self._frames = 0
        self._flooded = 0
        self._exact: npt.NDArray[np.float32] | None = None
        self._rounded: Image | None = None
        self._last: tuple[Image, npt.NDArray[np.float64]] | None = None
        """The last frame and its gains."""

    def prepare(self, images: Sequence[Image]) -> None:
        """Learn the background from images before the first frame; without any, learn it live."""
        for image in images:
            self._sample(image)
        if self._samples:
            self._take_median()
            self._frames, self._samples = self._settings.bootstrap_frames, []

    def segment_still(self, image: Image) -> Segmentation | None:
        """Segment an image that is not the next frame."""
        return None if self._rounded is None else self._compare(image, self._rounded)[0]

    def segment(self, image: Image) -> Segmentation | None:
        """Segment the next frame; `None` while the background is unknown."""
        self._bootstrap(image)
        self._frames += 1
        if self._rounded is None:
            return None
        segmentation, gains = self._compare(image, self._rounded)
        self._last = image, gains
        self._relearn_on_light_change(segmentation.foreground | segmentation.shadow)
        return segmentation

    def learn(self, foreground: Mask, occupied: Mask) -> None:
        """Update the background with the last frame, except where people are.

        Args:
            foreground: `(H, W)`, the cleaned foreground of that frame.
            occupied: `(H, W)`, 255 where a person is.
        """
        if self._exact is None or self._rounded is None or self._last is None:
            return
        checks_static, updates = self._static_filter.is_due(), self._frames % self._settings.learn_every == 0
        if not (checks_static or updates):
            return
        # The frame at the background's gain.
        leveled = apply_gains(self._last[0], 1.0 / self._last[1])
        static = self._static_filter.find(leveled, self._rounded, foreground) if checks_static else None
        if static is not None:
            self._exact[static > 0] = leveled[static > 0]
        if updates:
            unoccupied = cv2.bitwise_not(occupied)
            cv2.accumulateWeighted(leveled, self._exact, self._settings.learn_rate, mask=unoccupied)
        elif static is None:
            return
        self._rounded = np.rint(self._exact).astype(np.uint8)

    def _compare(self, image: Image, background: Image) -> tuple[Segmentation, npt.NDArray[np.float64]]:
        """Return the segmentation against the background at the image's gains, and the gains."""
        gains = gains_over_reference(image, background)
        expected = apply_gains(background, gains)
        blue, green, red = cv2.split(cv2.absdiff(image, expected))
        difference = cv2.max(cv2.max(blue, green), red)
        _, binary = cv2.threshold(difference, self._settings.threshold, 255, cv2.THRESH_BINARY)
        mask = np.asarray(binary, dtype=np.uint8)
        shadow = shadow_mask(image, expected, mask, self._shadows)
        return Segmentation(mask & ~shadow, shadow), gains

    def _bootstrap(self, image: Image) -> None:
        settings = self._settings
        if self._frames >= settings.bootstrap_frames:
            return
        # Spread the samples evenly, the last one on the last frame.
        used = (self._frames + 1) * settings.samples // settings.bootstrap_frames
        if used > self._frames * settings.samples // settings.bootstrap_frames:
            self._sample(image)
        done = self._frames + 1
        if done in {(settings.bootstrap_frames + 1) // 2, settings.bootstrap_frames} and self._samples:
            self._take_median()
        if done == settings.bootstrap_frames:
            self._samples = []

    def _sample(self, image: Image) -> None:
        first = self._samples[0] if self._samples else image
        self._samples.append(apply_gains(image, 1.0 / gains_over_reference(image, first)))

    def _take_median(self) -> None:
        ordered = np.sort(np.stack(self._samples), axis=0)
        self._rounded = np.asarray(ordered[len(ordered) // 2], dtype=np.uint8)
        self._exact = self._rounded.astype(np.float32)

    def _relearn_on_light_change(self, mask: Mask) -> None:
        flooded = cv2.countNonZero(mask) > self._settings.relearn_share * mask.size
        self._flooded = self._flooded + 1 if flooded else 0
        if self._flooded >= self._settings.relearn_frames:
            self._frames = 0
            self._flooded = 0
            self._samples = []
