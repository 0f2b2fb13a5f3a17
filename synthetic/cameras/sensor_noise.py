"""Sensor noise and the slow drift of the exposure."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

_BANK = 6  # noise images; each frame uses one, shifted by a hash
_SPARE = 64  # pixels by which a noise image is larger than a frame
_GRAIN = 1.7  # standard deviation, gray levels
_COLOR = 0.8  # standard deviation of the independent noise of each channel, gray levels
_MIDDLE = 128
_DRIFT = 0.018  # amplitude of the brightness drift, as a share
_PERIODS = (97.0, 41.0)  # seconds


@lru_cache(maxsize=4)
def _noise_images(width: int, height: int, seed: int) -> tuple[NDArray[np.uint8], ...]:
    images = []
    for index in range(_BANK):
        rng = np.random.default_rng([seed, 0x0015E, index])
        shape = (height + _SPARE, width + _SPARE)
        grain = rng.standard_normal((*shape, 1), dtype=np.float32) * _GRAIN
        color = rng.standard_normal((*shape, 3), dtype=np.float32) * _COLOR
        images.append(np.rint(grain + color + _MIDDLE).clip(0, 255).astype(np.uint8))
    return tuple(images)


def _hash(camera: int, frame: int, seed: int) -> int:
    value = (frame * 0x9E3779B97F4A7C15 + camera * 0xC2B2AE3D27D4EB4F + seed * 0x165667B19E3779F9) % (1 << 64)
    value = (value ^ (value >> 29)) * 0xBF58476D1CE4E5B9 % (1 << 64)
    return value ^ (value >> 32)


def add_noise_and_drift(
    image: NDArray[np.uint8], camera: int, frame: int, seconds: float, seed: int
) -> NDArray[np.uint8]:
    """Return an image ``(H, W, 3)`` with the sensor noise and exposure drift of one camera's frame."""
    height, width = image.shape[:2]
    hashed = _hash(camera, frame, seed)
    noise = _noise_images(width, height, seed)[hashed % _BANK]
    x, y = hashed // 64 % _SPARE, hashed // 4096 % _SPARE
    waves = (math.sin(2 * math.pi * (seconds / period + 0.31 * camera)) for period in _PERIODS)
    gain = 1.0 + _DRIFT * sum(waves) / 2
    noisy = cv2.addWeighted(image, gain, noise[y : y + height, x : x + width], 1.0, -_MIDDLE)
    return np.asarray(noisy, dtype=np.uint8)
