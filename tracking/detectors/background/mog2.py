"""Mixture-of-Gaussians background model, for comparison and for moving vegetation."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.detectors.background.segmentation import Segmentation
from tracking.detectors.base import Image, Mask

_SHADOW = 127


@dataclass(frozen=True, slots=True)
class Mog2Settings:
    """OpenCV's MOG2. It absorbs people who stand still."""

    history_frames: int = 500  # frames over which the background is learned
    variance_threshold: float = 25.0  # squared standard deviations that count as foreground
    detect_shadows: bool = True  # separate shadows from the foreground
    warm_up_frames: int = 25  # frames before the first segmentation


class Mog2Background:
    """MOG2 with the interface of the median background."""

    def __init__(self, settings: Mog2Settings) -> None:
        self._settings = settings
        self._frames = 0
        self._model = cv2.createBackgroundSubtractorMOG2(
            settings.history_frames, settings.variance_threshold, settings.detect_shadows
        )

    def segment(self, image: Image) -> Segmentation | None:
        """Segment the next frame and update the mixture; `None` during the warm-up."""
        mask = self._model.apply(image)
        self._frames += 1
        if self._frames <= self._settings.warm_up_frames:
            return None
        full, none = np.uint8(255), np.uint8(0)
        return Segmentation(
            np.where(mask > _SHADOW, full, none), np.where(mask == _SHADOW, full, none), image
        )

    def learn(self, foreground: Mask, occupied: Mask) -> None:
        """Do nothing: `segment` has updated the mixture."""
