"""People in a room: the world of every scene that has a ground plane."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.camera_view import CameraView, DrawnPerson
from synthetic.cameras.pinhole import Floats, PinholeCamera, Viewpoint
from synthetic.drawing.clothing import Outfit
from synthetic.drawing.figure import paste
from synthetic.drawing.shadow import cast_shadow
from synthetic.ground_truth import CameraTruth, measure_truth
from synthetic.room.room import Room
from synthetic.walking.trajectory import Pose
from synthetic.world import Bytes, SceneParameters

_VIEWS = 12
"""Empty rooms kept, which take a second each to draw: all cameras of a scene, of all its instances."""


class Crowd(Protocol):
    """The people of a room: all poses at any moment."""

    def poses(self, seconds: float) -> list[Pose]:
        """Return all poses at a moment of the scene."""
        ...


class RoomWorld:
    """A crowd in a room with cameras. A camera's empty room is drawn on first use."""

    def __init__(
        self, room: Room, crowd: Crowd, outfits: Sequence[Outfit], parameters: SceneParameters
    ) -> None:
        self.room = room
        self._crowd = crowd
        self._outfits = outfits
        self._size = (parameters.width, parameters.height)
        # A recording needs the image and the ground truth of a frame: people are drawn once for both.
        self._people = lru_cache(maxsize=parameters.cameras)(self._draw_visible_people)

    @property
    def extent(self) -> tuple[float, float]:
        """The room's floor."""
        return (self.room.width, self.room.depth)

    def picture(self, camera: int, seconds: float) -> Bytes:
        """Return the image of the room with all people."""
        return compose(self.camera_view(camera), self._people(camera, seconds))

    def background(self, camera: int, seconds: float) -> Bytes:  # noqa: ARG002 — a room is static
        """Return the image of the room without people."""
        return self.camera_view(camera).backdrop.image.copy()

    def truth(self, camera: int, seconds: float) -> CameraTruth:
        """Measure the ground truth on the drawn people."""
        return measure_truth(self.camera_view(camera), self._people(camera, seconds))

    def positions(self, seconds: float) -> Floats:
        """Return all positions; corridors are outside the room's floor."""
        poses = self._crowd.poses(seconds)
        return np.array([(pose.x, pose.y) for pose in poses], dtype=np.float64).reshape(-1, 2)

    def inside(self, seconds: float) -> NDArray[np.bool_]:
        """Return which people are in the room, not in a corridor."""
        positions = self.positions(seconds).tolist()
        return np.array([self.room.signed_distance_outside(x, y) <= 0 for x, y in positions], dtype=np.bool_)

    def homography(self, camera: int) -> Floats:
        """Return the homography from a camera's pixels to the floor."""
        return self.view(camera).homography()

    def view(self, camera: int) -> PinholeCamera:
        """Return a camera's projection."""
        return PinholeCamera.at(self.room.viewpoints[camera], *self._size)

    def camera_view(self, camera: int) -> CameraView:
        """Return a camera's view of the empty room."""
        return _camera_view(self.room, self.room.viewpoints[camera], self._size)

    def _draw_visible_people(self, camera: int, seconds: float) -> tuple[DrawnPerson, ...]:
        return tuple(self.camera_view(camera).draw_visible_people(self._crowd.poses(seconds), self._outfits))


@lru_cache(maxsize=_VIEWS)
def _camera_view(room: Room, viewpoint: Viewpoint, size: tuple[int, int]) -> CameraView:
    return CameraView(room, PinholeCamera.at(viewpoint, *size))


def compose(camera_view: CameraView, people: Sequence[DrawnPerson]) -> Bytes:
    """Compose a noiseless BGR image ``(H, W, 3)``: empty room, shadows, then people."""
    image = camera_view.backdrop.image.copy()
    for person in people:
        if person.inside:
            cast_shadow(image, camera_view.backdrop.floor, camera_view.view, person.joints)
    for person in people:
        paste(image, camera_view.view, person.figure, person.visible_mask)
    return image
