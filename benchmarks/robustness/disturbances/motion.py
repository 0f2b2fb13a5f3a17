"""Disturbances that move the picture; the true boxes move along."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.robustness.disturbances.base import Affine, Disturbance, Effect, Moment, as_image, fade
from server.camera.sources import Image


@dataclass(frozen=True)
class _Moving(Disturbance):
    """Moves the picture; what comes into view is the reflection of the margin."""

    def apply(self, image: Image, moment: Moment) -> Image:
        """Move the picture."""
        height, width = image.shape[:2]
        matrix = self.motion(moment, (width, height))
        if matrix is None:
            return image
        moved = cv2.warpAffine(
            image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101
        )
        return np.asarray(moved, dtype=np.uint8)


@dataclass(frozen=True)
class Knock(_Moving):
    """The camera is knocked: the picture is shifted and rotated about its center from then on."""

    shift: float
    degrees: float

    def motion(self, moment: Moment, size: tuple[int, int]) -> Affine:
        """Return the knock, in a direction of each camera's own."""
        angle, turn = moment.random("knock", lasting=True).uniform([0.0, -1.0], [2.0 * np.pi, 1.0])
        matrix = rotation(np.copysign(self.degrees, turn), size)
        matrix[:, 2] += self.shift * size[0] * np.array([np.cos(angle), np.sin(angle)])
        return matrix


@dataclass(frozen=True)
class Sway(_Moving):
    """The mast sways in the wind."""

    amplitude: float
    across_hz: float = 0.7
    down_hz: float = 1.1

    def motion(self, moment: Moment, size: tuple[int, int]) -> Affine:
        """Return the shift of the moment."""
        turns = np.array([self.across_hz, self.down_hz]) * moment.seconds
        phases = moment.random("sway", lasting=True).random(2)
        matrix = rotation(0.0, size)
        matrix[:, 2] = self.amplitude * size[0] * np.sin(2.0 * np.pi * (turns + phases))
        return matrix


@dataclass(frozen=True)
class TurnedAway(_Moving):
    """The camera is turned to the side within a second; people who stay in view are true ones."""

    shift: float
    takes_s: float = 1.0

    def motion(self, moment: Moment, size: tuple[int, int]) -> Affine:
        """Return the shift of the moment."""
        matrix = rotation(0.0, size)
        matrix[0, 2] = self.shift * size[0] * fade(moment.seconds, 0.0, self.takes_s)
        return matrix

    def begin(self) -> Effect:
        """Return what moves the pictures; what comes into view is a wall, in the light of the moment.

        It has the colors of the margin of the first picture, so that it stands still whoever walks there.
        """
        first: list[Image] = []

        def turn(image: Image, moment: Moment) -> Image:
            if not first:
                first.append(image)
            height, width = image.shape[:2]
            matrix = self.motion(moment, (width, height))
            moved = cv2.warpAffine(image, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
            new = round(float(matrix[0, 2]))
            if new > 0:
                wall = cv2.blur(first[0][:, :1], (1, max(height // 4, 1)))
                moved[:, :new] = as_image(wall * _light(first[0], image))
            return np.asarray(moved, dtype=np.uint8)

        return turn


def _light(before: Image, image: Image) -> NDArray[np.float32]:
    """Return by how much most of a picture is brighter than one before it, in each channel."""
    ratio = (image[::4, ::4].astype(np.float32) + 1.0) / (before[::4, ::4].astype(np.float32) + 1.0)
    return np.asarray(np.median(ratio, axis=(0, 1)), dtype=np.float32)


def rotation(degrees: float, size: tuple[int, int]) -> Affine:
    """Return a rotation about the center of a picture of `size` = (width, height)."""
    center = (size[0] / 2.0, size[1] / 2.0)
    return np.asarray(cv2.getRotationMatrix2D(center, degrees, 1.0), dtype=np.float64)
