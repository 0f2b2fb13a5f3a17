"""The interface of disturbances."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from server.camera.sources import Image

Floats = NDArray[np.float32]
Affine = NDArray[np.float64]
"""(2, 3): from a point (x, y, 1) of the undisturbed picture to the disturbed one, pixels."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When a picture is disturbed, and the seed of what is random in it.

    Attributes:
        frame: frames since the disturbance began, from 0.
        seconds: the same in seconds.
        seed: of the run.
        camera: the index of the camera: each has its own random numbers.
    """

    frame: int
    seconds: float
    seed: int
    camera: int

    def random(self, purpose: str, *, lasting: bool = False) -> np.random.Generator:
        """Return random numbers of this frame, or with `lasting` the same ones in all frames."""
        number = 0 if lasting else self.frame + 1
        return np.random.default_rng([self.seed, self.camera, number, zlib.crc32(purpose.encode())])


Effect = Callable[[Image, Moment], Image | None]
"""Returns the disturbed picture; None: there is none. Frames ascend."""


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Something that happens to a camera's pictures. Lengths are shares of the picture's width.

    Attributes:
        lasts_s: its length in seconds; None: to the end of the recording.
        one_camera: whether it happens to the first camera only, not to all.
    """

    lasts_s: float | None = None
    one_camera: bool = False

    def begin(self) -> Effect:
        """Return what disturbs the pictures of one camera; some remember earlier pictures."""
        return self.apply

    def apply(self, image: Image, moment: Moment) -> Image | None:
        """Return the disturbed picture, where it depends on this one only."""
        raise NotImplementedError

    def motion(self, moment: Moment, size: tuple[int, int]) -> Affine | None:
        """Return how the picture of `size` = (width, height) has moved; None: it has not."""
        del moment, size
        return None

    def cover(self, moment: Moment, size: tuple[int, int]) -> Floats | None:
        """Return how much of each pixel (H, W) of the scene is hidden, 0 to 1; None: nothing is."""
        del moment, size
        return None


def blend(image: Image, other: Floats | float, share: Floats) -> Image:
    """Return a picture of which the `share` (H, W) of each pixel is replaced by other gray levels."""
    return as_image(image + (other - image.astype(np.float32)) * share[:, :, None])


def as_image(levels: NDArray[np.floating]) -> Image:
    """Return gray levels (H, W, 3) as a picture: rounded, and clipped to 0 to 255."""
    return np.asarray(np.clip(levels + 0.5, 0, 255), dtype=np.uint8)


def blurred(image: Image, sigma: float) -> Image:
    """Return a picture blurred by a Gaussian; `sigma` is a share of the width."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), max(sigma * image.shape[1], 0.01)), dtype=np.uint8)


def smooth_field(random: np.random.Generator, shape: tuple[int, ...], grain: float) -> Floats:
    """Return a smooth random field (H, W) in [0, 1].

    `grain` is the size of its spots, a share of the width.
    """
    cells = max(round(1.0 / grain), 2)
    rows = max(round(cells * shape[0] / shape[1]), 2)
    coarse = random.random((rows, cells), dtype=np.float32)
    return np.asarray(
        cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC), dtype=np.float32
    ).clip(0.0, 1.0)


def fade(value: float, start: float, width: float) -> float:
    """Return 0 below `start` and 1 from `start` + `width` on, smoothly between."""
    share = min(max((value - start) / width, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
