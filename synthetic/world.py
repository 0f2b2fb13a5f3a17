"""The interface of a scene's world, which cameras look at and which knows the ground truth."""

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
    """The size of a scene to draw; the numbers are within their ranges."""

    cameras: int
    objects: int
    seed: int
    width: int  # pixels
    height: int  # pixels


class World(Protocol):
    """A pure function of the parameters and of a moment, in seconds; cameras count from 0.

    Pictures are noiseless: the sensor is the scene's, not the world's.
    """

    @property
    def extent(self) -> tuple[float, float]:
        """Its size from west to east and from south to north, in meters."""
        ...

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Return a camera's picture ``(H, W, 3)``, blue, green, red."""
        ...

    def background(self, camera: int, seconds: float) -> Bytes:
        """Return a camera's picture ``(H, W, 3)`` without any of the objects."""
        ...

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Return a camera's ground truth: ids, boxes and visible shares."""
        ...

    def positions(self, seconds: float) -> Floats:
        """Return where all objects are, seen from above: ``(objects, 2)`` meters."""
        ...

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Return which objects are within the world's extent: ``(objects,)``."""
        ...

    def homography(self, camera: int) -> Floats | None:
        """Return the homography ``(3, 3)`` from pixels to the floor, in meters; None without a floor."""
        ...
