"""What a scene is behind its name: something that cameras look at, and that knows what is true."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.ground_truth import CameraTruth

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Asked:
    """What somebody wants drawn; the numbers are within their ranges."""

    cameras: int
    objects: int
    seed: int
    width: int  # pixels
    height: int  # pixels


class World(Protocol):
    """A pure function of what was asked for and of a moment, in seconds; cameras count from 0.

    Pictures are noiseless: the sensor is the scene's, not the world's.
    """

    @property
    def extent(self) -> tuple[float, float]:
        """How far it reaches from west to east and from south to north, metres."""
        ...

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Give a camera's picture ``(H, W, 3)``, blue, green, red."""
        ...

    def empty(self, camera: int, seconds: float) -> Bytes:
        """Give a camera's picture ``(H, W, 3)`` without any of the objects."""
        ...

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Say who is in a camera's picture, where, and how much of them shows."""
        ...

    def positions(self, seconds: float) -> Floats:
        """Say where everybody is, seen from above: ``(objects, 2)`` metres."""
        ...

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Say who is within the world's extent: ``(objects,)``."""
        ...

    def homography(self, camera: int) -> Floats | None:
        """Give the ``(3, 3)`` map from a camera's pixels to the floor, metres; None: nobody is on a floor."""
        ...
