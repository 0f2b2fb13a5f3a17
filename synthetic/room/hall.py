"""People in a room: the world of every scene that has a floor to walk on."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.camera_view import Actor, Stage
from synthetic.cameras.pinhole import Floats, Perspective
from synthetic.drawing.clothing import Outfit
from synthetic.drawing.compositing import compose
from synthetic.ground_truth import CameraTruth, judge
from synthetic.room.room import Room
from synthetic.walking.stroll import Pose
from synthetic.world import Asked, Bytes


class Company(Protocol):
    """The people of a hall: who is where when."""

    def poses(self, seconds: float) -> list[Pose]:
        """Give everybody's pose at a moment of the scene."""
        ...


class Hall:
    """A company in a room under cameras. A camera's empty room is painted when it is first asked for."""

    def __init__(self, room: Room, company: Company, outfits: Sequence[Outfit], asked: Asked) -> None:
        self.room = room
        self._company = company
        self._outfits = outfits
        self._size = (asked.width, asked.height)
        self.stage = lru_cache(maxsize=None)(self._set_stage)
        # A recording asks for the picture and the truth of a frame: its figures are drawn once for both.
        self._actors = lru_cache(maxsize=asked.cameras)(self._act)

    @property
    def extent(self) -> tuple[float, float]:
        """The room's floor."""
        return (self.room.width, self.room.depth)

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Paint the room with everybody in it."""
        return compose(self.stage(camera), self._actors(camera, seconds))

    def empty(self, camera: int, seconds: float) -> Bytes:  # noqa: ARG002 — nothing in a room moves by itself
        """Paint the room without people."""
        return self.stage(camera).backdrop.image.copy()

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Measure everybody as they are drawn."""
        return judge(self.stage(camera), self._actors(camera, seconds))

    def positions(self, seconds: float) -> Floats:
        """Say where everyone stands; in a corridor that is off the room's floor."""
        poses = self._company.poses(seconds)
        return np.array([(pose.x, pose.y) for pose in poses], dtype=np.float64).reshape(-1, 2)

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Say who is in the room."""
        where = self.positions(seconds).tolist()
        return np.array([self.room.outside(x, y) <= 0 for x, y in where], dtype=np.bool_)

    def homography(self, camera: int) -> Floats:
        """Map a camera's pixels to the floor."""
        return self.view(camera).homography()

    def view(self, camera: int) -> Perspective:
        """Give a camera's projection."""
        return Perspective.of(self.room.viewpoints[camera], *self._size)

    def _set_stage(self, camera: int) -> Stage:
        return Stage(self.room, self.view(camera))

    def _act(self, camera: int, seconds: float) -> tuple[Actor, ...]:
        return tuple(self.stage(camera).actors(self._company.poses(seconds), self._outfits))
