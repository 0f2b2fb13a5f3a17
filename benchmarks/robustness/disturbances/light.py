"""Disturbances of light and of the sensor's response to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.robustness.disturbances.base import Disturbance, Moment, as_image, fade
from server.camera.sources import Image

_LEVELS = np.arange(256, dtype=np.float64)


@dataclass(frozen=True)
class Gamma(Disturbance):
    """A tone curve: below 1 it brightens shadows and compresses highlights."""

    exponent: float

    def apply(self, image: Image, moment: Moment) -> Image:
        """Apply the curve."""
        del moment
        return as_image(255.0 * (_LEVELS / 255.0) ** self.exponent)[image]


@dataclass(frozen=True)
class Gain(Disturbance):
    """All channels times a factor; what exceeds white is lost."""

    factor: float

    def apply(self, image: Image, moment: Moment) -> Image:
        """Multiply."""
        del moment
        return as_image(self.factor * _LEVELS)[image]


@dataclass(frozen=True)
class ExposureJump(Disturbance):
    """A jump of the exposure that the camera takes back by part, as an automatic exposure does."""

    factor: float
    remaining: float = 0.4
    """Share of the jump that stays, in logarithms."""
    settles_s: float = 3.0

    def apply(self, image: Image, moment: Moment) -> Image:
        """Multiply by the exposure of the moment."""
        share = self.remaining + (1.0 - self.remaining) * np.exp(-moment.seconds / self.settles_s)
        return as_image(self.factor**share * _LEVELS)[image]


@dataclass(frozen=True)
class WhiteBalance(Disturbance):
    """Blue and red multiplied by opposite factors."""

    blue: float

    def apply(self, image: Image, moment: Moment) -> Image:
        """Multiply the channels."""
        del moment
        return as_image(image.astype(np.float32) * np.array([self.blue, 1.0, 1.0 / self.blue], np.float32))


@dataclass(frozen=True)
class Sun(Disturbance):
    """Sunlight on the right half that comes and goes with the clouds."""

    factor: float
    period_s: float = 8.0
    edge: float = 0.03

    def apply(self, image: Image, moment: Moment) -> Image:
        """Brighten the half by what the clouds let through."""
        phase = moment.seconds % self.period_s
        sun = fade(phase, 0.0, 1.0) - fade(phase, 0.5 * self.period_s, 1.0)
        columns = np.arange(image.shape[1], dtype=np.float64) / image.shape[1]
        lit = np.clip((columns - 0.5) / self.edge + 0.5, 0.0, 1.0)
        gains = (1.0 + (self.factor - 1.0) * sun * lit).astype(np.float32)
        return as_image(image * gains[None, :, None])


@dataclass(frozen=True)
class LampFlicker(Disturbance):
    """Lamps at the mains' frequency beside the shutter: brightness beats, in bands from row to row."""

    depth: float
    beat_hz: float = 3.1
    bands: float = 1.5
    """Bands over the height of the picture."""

    def apply(self, image: Image, moment: Moment) -> Image:
        """Multiply the rows."""
        rows = np.arange(image.shape[0], dtype=np.float64) / image.shape[0]
        wave = np.sin(2.0 * np.pi * (self.beat_hz * moment.seconds + self.bands * rows))
        return as_image(image * (1.0 + self.depth * wave).astype(np.float32)[:, None, None])


@dataclass(frozen=True)
class Noise(Disturbance):
    """Independent noise of every pixel."""

    levels: float
    """Its standard deviation, in gray levels of 255."""

    def apply(self, image: Image, moment: Moment) -> Image:
        """Add the noise."""
        noise = moment.random("noise").standard_normal(image.shape, dtype=np.float32)
        return as_image(image + np.float32(self.levels) * noise)


@dataclass(frozen=True)
class Night(Disturbance):
    """Little light, little color, and the noise of the amplified sensor."""

    light: float
    """Brightness, of the undisturbed one."""
    levels: float
    """Standard deviation of the noise, in gray levels."""
    color: float = 0.3
    """Share of the color that is left."""

    def apply(self, image: Image, moment: Moment) -> Image:
        """Darken and add noise."""
        gray = image.mean(axis=2, keepdims=True, dtype=np.float32)
        dark = np.float32(self.light) * (gray + np.float32(self.color) * (image - gray))
        noise = moment.random("night").standard_normal(image.shape, dtype=np.float32)
        return as_image(dark + np.float32(self.levels) * noise)
