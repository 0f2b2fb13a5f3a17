"""A synthetic scene: what its cameras see at any frame, and what is true there."""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from server.camera.scene.catalogue import scene_room
from server.camera.scene.noise import expose
from server.camera.scene.outfits import outfit
from server.camera.scene.perspective import Floats, Perspective
from server.camera.scene.render import compose
from server.camera.scene.stage import Actor, Stage
from server.camera.scene.stroll import Pose
from server.camera.scene.truth import CameraTruth, judge
from server.camera.scene.walkers import Walkers


class Scene:
    """Walkers in a room under several cameras: a pure function of its arguments, endless in time.

    Any frame may be asked for in any order in any process and is equal to the byte. A camera's empty
    room is painted when the camera is first asked for.

    Args:
        name: one of `scene_names()`.
        cameras: how many cameras look, at most as many as the room has places for.
        objects: how many people come and go; their ids count from 1.
        seed: of everything random, not negative.
        width: of a picture, pixels.
        height: of a picture, pixels.
        fps: frames per second.

    Raises:
        ValueError: for an unknown name or a number out of its range, in one line.
    """

    def __init__(
        self,
        name: str = "room",
        cameras: int = 3,
        objects: int = 4,
        seed: int = 0,
        width: int = 640,
        height: int = 360,
        fps: float = 25.0,
    ) -> None:
        self._room = scene_room(name)
        _check("cameras", cameras, 1, len(self._room.viewpoints))
        _check("objects", objects, 0, 64)
        _check("seed", seed, 0, 2**63 - 1)
        _check("width", width, 64, 4096)
        _check("height", height, 36, 4096)
        _check("fps", fps, 1, 240)
        self.name, self.cameras, self.objects, self.seed = name, cameras, objects, seed
        self.width, self.height, self.fps = width, height, float(fps)
        self._walkers = Walkers(self._room, objects, seed)
        self._outfits = [outfit(walker, seed) for walker in range(objects)]
        self._stage = lru_cache(maxsize=None)(self._set_stage)
        # A recording asks for the picture and the truth of a frame: its figures are drawn once for both.
        self._actors = lru_cache(maxsize=cameras)(self._act)

    def image(self, camera: int, frame: int) -> NDArray[np.uint8]:
        """Give a camera's picture ``(H, W, 3)``, blue, green, red. Cameras and frames count from 0."""
        self._check_frame(frame)
        stage = self._stage(camera)
        clean = compose(stage, self._actors(camera, frame))
        return expose(clean, camera, frame, frame / self.fps, self.seed)

    def empty(self, camera: int) -> NDArray[np.uint8]:
        """Give a camera's picture ``(H, W, 3)`` of the room without people, noise and drift."""
        return self._stage(camera).backdrop.image.copy()

    def truth(self, frame: int) -> tuple[CameraTruth, ...]:
        """Say for every camera who is in its picture, where, and how much of them shows."""
        self._check_frame(frame)
        return tuple(
            judge(self._stage(camera), self._actors(camera, frame)) for camera in range(self.cameras)
        )

    def ground_position(self, frame: int) -> Floats:
        """Say where everyone stands: ``(objects, 2)`` metres; in a corridor that is off the room's floor."""
        self._check_frame(frame)
        return np.array([(pose.x, pose.y) for pose in self._poses(frame)], dtype=np.float64).reshape(-1, 2)

    def inside(self, frame: int) -> NDArray[np.bool_]:
        """Say who is in the room: ``(objects,)``."""
        where = self.ground_position(frame)
        return np.array([self._room.outside(x, y) <= 0 for x, y in where.tolist()], dtype=np.bool_)

    def homography(self, camera: int) -> Floats:
        """Give the ``(3, 3)`` map from a camera's pixels (homogeneous) to the floor, in metres."""
        return self._view(camera).homography()

    @cached_property
    def floor(self) -> tuple[float, float]:
        """The room's extent, west to east and south to north, metres."""
        return (self._room.width, self._room.depth)

    def _check_frame(self, frame: int) -> None:
        if frame < 0:
            raise ValueError(f"scene {self.name}: frame {frame} is before the first, 0")

    def _poses(self, frame: int) -> list[Pose]:
        return self._walkers.poses(frame / self.fps)

    def _act(self, camera: int, frame: int) -> tuple[Actor, ...]:
        return tuple(self._stage(camera).actors(self._poses(frame), self._outfits))

    def _view(self, camera: int) -> Perspective:
        if not 0 <= camera < self.cameras:
            raise ValueError(f"scene {self.name}: there is no camera {camera} among {self.cameras}")
        return Perspective.of(self._room.viewpoints[camera], self.width, self.height)

    def _set_stage(self, camera: int) -> Stage:
        return Stage(self._room, self._view(camera))


def _check(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"scene: {what} must be {low} to {high}, not {value}")
