"""Fog, rain, and things that move in the background."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.robustness.disturbances.base import (
    Disturbance,
    Floats,
    Moment,
    as_image,
    blend,
    fade,
    smooth_field,
)
from server.camera.sources import Image


@dataclass(frozen=True)
class Fog(Disturbance):
    """Gray fog that comes up, denser far away: towards the picture's top."""

    density: float
    """Share of the picture's contrast that is lost at the top."""
    comes_s: float = 4.0
    level: float = 190.0
    near: float = 0.4
    """Density at the bottom, of that at the top."""

    def apply(self, image: Image, moment: Moment) -> Image:
        """Blend with the fog, whose banks drift."""
        height, width = image.shape[:2]
        depth = np.linspace(1.0, self.near, height, dtype=np.float32)[:, None]
        banks = smooth_field(moment.random("fog", lasting=True), (height, 2 * width), 0.2)
        drift = round(0.02 * width * moment.seconds) % width
        share = self.density * fade(moment.seconds, 0.0, self.comes_s) * depth
        return blend(image, self.level, np.asarray(share * (0.8 + 0.2 * banks[:, drift : drift + width])))


@dataclass(frozen=True)
class Rain(Disturbance):
    """Bright streaks, other ones in every frame."""

    streaks: int
    """In a frame."""
    length: float = 0.06
    opacity: float = 0.45
    slant: float = 0.15

    def apply(self, image: Image, moment: Moment) -> Image:
        """Draw the streaks."""
        height, width = image.shape[:2]
        random = moment.random("rain")
        starts = random.uniform((-0.1 * width, -0.1 * height), (1.1 * width, height), (self.streaks, 2))
        lengths = self.length * width * random.uniform(0.5, 1.5, self.streaks)
        ends = starts + lengths[:, None] * np.array([self.slant, 1.0])
        drawn = np.zeros((height, width), dtype=np.uint8)
        lines = np.stack([starts, ends], axis=1).round().astype(np.int32)
        cv2.polylines(drawn, list(lines), isClosed=False, color=255, thickness=max(width // 500, 1))
        return blend(
            image, 225.0, self.opacity / 255.0 * cv2.GaussianBlur(drawn, (3, 3), 0).astype(np.float32)
        )


@dataclass(frozen=True)
class MovingTree(Disturbance):
    """A tree in the wind at a side of the picture: leaves in front of everything there."""

    extent: float
    """Of the picture's width."""
    period_s: float = 1.7

    def apply(self, image: Image, moment: Moment) -> Image:
        """Draw the leaves; gusts move them to and fro."""
        height, width = image.shape[:2]
        canvas = image.copy()
        self._draw(canvas, moment, (width, height), (60.0, 140.0, 80.0))
        return canvas

    def cover(self, moment: Moment, size: tuple[int, int]) -> Floats:
        """Return the leaves."""
        leaves = np.zeros((size[1], size[0], 3), dtype=np.uint8)
        self._draw(leaves, moment, size, (255.0, 255.0, 255.0))
        return (leaves[:, :, 0] > 0).astype(np.float32)

    def _draw(self, canvas: Image, moment: Moment, size: tuple[int, int], color: Sequence[float]) -> None:
        random = moment.random("tree", lasting=True)
        count = round(900 * self.extent)
        places = random.uniform((-0.02, 0.0), (self.extent, 0.75), (count, 2))
        shades = random.uniform(0.4, 1.0, count)
        phases = random.uniform(0.0, 0.6, count)
        swing = np.sin(2.0 * np.pi * (moment.seconds / self.period_s + phases + 2.0 * places[:, 1]))
        places[:, 0] += 0.25 * self.extent * swing * (0.3 + places[:, 1])
        radius = max(round(0.012 * size[0]), 1)
        pixels = (places * size).round().astype(int)
        for (x, y), shade in zip(pixels.tolist(), shades.tolist(), strict=True):
            leaf = [shade * channel for channel in color]
            cv2.ellipse(canvas, (x, y), (radius, 2 * radius), 30.0, 0.0, 360.0, leaf, -1)


@dataclass(frozen=True)
class MovingScreen(Disturbance):
    """A screen on the wall, of another picture every second, and of something that moves in it."""

    extent: float
    """Its width, of the picture's."""
    changes_s: float = 1.0

    def apply(self, image: Image, moment: Moment) -> Image:
        """Draw the screen."""
        height, width = image.shape[:2]
        wide, tall = self._sides((width, height))
        shot = int(moment.seconds / self.changes_s)
        random = np.random.default_rng([moment.seed, moment.camera, shot])
        content = 255.0 * np.stack([smooth_field(random, (tall, wide), 0.3) for _ in range(3)], axis=2)
        across = int((moment.seconds / 3.0 % 1.0) * wide)
        content[tall // 4 :, across : across + wide // 6] = random.uniform(0, 255, 3)
        canvas = image.copy()
        canvas[self._place(moment, (width, height))] = as_image(content)
        return canvas

    def cover(self, moment: Moment, size: tuple[int, int]) -> Floats:
        """Return the screen."""
        screen = np.zeros(size[::-1], dtype=np.float32)
        screen[self._place(moment, size)] = 1.0
        return screen

    def _place(self, moment: Moment, size: tuple[int, int]) -> tuple[slice, slice]:
        """Return the rows and columns of the screen."""
        wide, tall = self._sides(size)
        left = round(moment.random("screen", lasting=True).uniform(0.1, 0.9 - self.extent) * size[0])
        top = round(0.05 * size[1])
        return slice(top, top + tall), slice(left, left + wide)

    def _sides(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return width and height of the screen, in pixels."""
        wide = max(round(self.extent * size[0]), 8)
        return wide, max(min(round(0.6 * wide), size[1] // 2), 1)
