"""Mixture-of-Gaussians background model, for comparison and for moving vegetation."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.detectors.background.segmentation import Segmentation
from tracking.detectors.base import Image, Mask, require_positive
from tracking.frame_rate import DEFAULT_FPS, frames_in

_SHADOW = 127


@dataclass(frozen=True, slots=True)
class Mog2Settings:
    """OpenCV's MOG2. It absorbs people who stand still.

    Raises:
        ValueError: a time is not positive.
    """

    history_s: float = 20.0  # seconds over which the background is learned
    variance_threshold: float = 25.0  # squared standard deviations that count as foreground
    detect_shadows: bool = True  # separate shadows from the foreground
    warm_up_s: float = 1.0  # seconds before the first segmentation

    def __post_init__(self) -> None:
        require_positive(self, "history_s", "warm_up_s")


class Mog2Background:
    """MOG2 with the interface of the median background."""

    def __init__(self, settings: Mog2Settings, fps: float = DEFAULT_FPS) -> None:
        self._warm_up_frames = frames_in(settings.warm_up_s, fps)
        self._frames = 0
        self._model = cv2.createBackgroundSubtractorMOG2(
            frames_in(settings.history_s, fps), settings.variance_threshold, settings.detect_shadows
        )

    def segment(self, image: Image) -> Segmentation | None:
        """Segment the next frame and update the mixture; `None` during the warm-up."""
        mask = self._model.apply(image)
        self._frames += 1
        if self._frames <= self._warm_up_frames:
            return None
        full, none = np.uint8(255), np.uint8(0)
        return Segmentation(
            np.where(mask > _SHADOW, full, none), np.where(mask == _SHADOW, full, none), image
        )

    def learn(self, foreground: Mask, occupied: Mask) -> None:
        """Do nothing: `segment` has updated the mixture."""
