"""A synthetic scene: the images of its cameras at any frame, and the ground truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.cameras.sensor_noise import add_noise_and_drift
from synthetic.catalog import catalog_entry
from synthetic.ground_truth import CameraTruth
from synthetic.world import SceneParameters


class Scene:
    """Moving objects in view of several cameras: a pure function of its arguments, unlimited in time.

    Frames may be drawn in any order and in any process, and are equal byte for byte. A camera's static
    background is drawn on first use.

    Args:
        name: one of `scene_names()`.
        cameras: number of cameras, at most the scene's viewpoints; None: the scene's default.
        objects: number of people or fish; their ids count from 1; None: the scene's default.
        seed: seed of all random numbers, not negative.
        width: of an image, pixels.
        height: of an image, pixels.
        fps: frames per second.

    Raises:
        ValueError: an unknown name, or a number out of range.
    """

    def __init__(
        self,
        name: str = "room",
        cameras: int | None = None,
        objects: int | None = None,
        seed: int = 0,
        width: int = 640,
        height: int = 360,
        fps: float = 25.0,
    ) -> None:
        entry = catalog_entry(name)
        cameras = entry.default_cameras if cameras is None else cameras
        objects = entry.default_objects if objects is None else objects
        _check("cameras", cameras, 1, entry.max_cameras)
        _check("objects", objects, 0, entry.max_objects)
        _check("seed", seed, 0, 2**63 - 1)
        _check("width", width, 64, 4096)
        _check("height", height, 36, 4096)
        _check("fps", fps, 1, 240)
        self.name, self.cameras, self.objects, self.seed = name, cameras, objects, seed
        self.width, self.height, self.fps = width, height, float(fps)
        self.world = entry.build(SceneParameters(cameras, objects, seed, width, height))

    def image(self, camera: int, frame: int) -> NDArray[np.uint8]:
        """Return a camera's BGR image ``(H, W, 3)``. Cameras and frames count from 0."""
        seconds = self._seconds(frame)
        clean = self.world.picture(self._checked(camera), seconds)
        return add_noise_and_drift(clean, camera, frame, seconds, self.seed)

    def clean_background(self, camera: int, frame: int = 0) -> NDArray[np.uint8]:
        """Return a camera's image ``(H, W, 3)`` without objects, noise and drift."""
        return self.world.background(self._checked(camera), self._seconds(frame))

    def truth(self, frame: int) -> tuple[CameraTruth, ...]:
        """Return the ground truth of every camera: ids, boxes and visible shares."""
        seconds = self._seconds(frame)
        return tuple(self.world.truth(camera, seconds) for camera in range(self.cameras))

    def ground_positions(self, frame: int) -> Floats:
        """Return all objects' positions, ``(objects, 2)`` meters; corridors are outside the room's floor."""
        return self.world.positions(self._seconds(frame))

    def inside(self, frame: int) -> NDArray[np.bool_]:
        """Return which objects are in the room: ``(objects,)``."""
        return self.world.inside(self._seconds(frame))

    def homography(self, camera: int) -> Floats | None:
        """Return the homography ``(3, 3)`` from a camera's pixels (homogeneous) to the floor, in meters.

        None in a scene without a floor.
        """
        return self.world.homography(self._checked(camera))

    @property
    def floor(self) -> tuple[float, float]:
        """The room's size, west to east and south to north, in meters."""
        return self.world.extent

    def _seconds(self, frame: int) -> float:
        if frame < 0:
            raise ValueError(f"scene {self.name}: frame {frame} is before the first, 0")
        return frame / self.fps

    def _checked(self, camera: int) -> int:
        if not 0 <= camera < self.cameras:
            raise ValueError(f"scene {self.name}: there is no camera {camera} among {self.cameras}")
        return camera


def _check(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"scene: {what} must be {low} to {high}, not {value}")
