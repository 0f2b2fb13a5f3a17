"""The interface of a scene's world: images and ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.ground_truth import CameraTruth

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class SceneParameters:
    """Validated parameters of a scene."""

    cameras: int
    objects: int
    seed: int
    width: int  # pixels
    height: int  # pixels


class World(Protocol):
    """A pure function of the parameters and of a moment, in seconds; cameras count from 0.

    Images are noiseless; the scene adds the sensor noise.
    """

    @property
    def extent(self) -> tuple[float, float]:
        """Its size from west to east and from south to north, in meters."""
        ...

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Return a camera's BGR image ``(H, W, 3)``."""
        ...

    def background(self, camera: int, seconds: float) -> Bytes:
        """Return a camera's image ``(H, W, 3)`` without the objects."""
        ...

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Return a camera's ground truth: ids, boxes and visible shares."""
        ...

    def positions(self, seconds: float) -> Floats:
        """Return the ground positions of all objects: ``(objects, 2)`` meters."""
        ...

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Return which objects are within the world's extent: ``(objects,)``."""
        ...

    def homography(self, camera: int) -> Floats | None:
        """Return the homography ``(3, 3)`` from pixels to the floor, in meters; None without a floor."""
        ...
