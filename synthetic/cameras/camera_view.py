"""One camera's view of a room: the empty room and the people in it, farthest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.backdrop import Backdrop, paint_backdrop
from synthetic.drawing.clothing import Outfit
from synthetic.drawing.figure import Figure, clip_to_image, draw_figure
from synthetic.drawing.limbs import build_body
from synthetic.drawing.skeleton import place_joints
from synthetic.room.room import Furniture, Room
from synthetic.room.surface_styles import surface_style
from synthetic.walking.trajectory import Pose

_THRESHOLD = 0.12  # meters behind the wall from which a person is visible through the doorway only
_OUT_OF_DOOR = 1.6  # meters to the side of a doorway's center from which a person is not visible through it
_LIGHT_GAIN = 1.12  # clothes have their nominal colors in the brightest part of the room

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class DrawnPerson:
    """A person in one camera's image."""

    walker: int
    joints: Floats  # (J, 3) meters
    figure: Figure
    inside: bool  # in the room, not in a corridor
    visible_mask: Bytes | None  # (h, w) of the patch within the image: visible share; None: fully visible


class CameraView:
    """The data to draw one camera's frames and to measure their ground truth."""

    def __init__(self, room: Room, view: PinholeCamera) -> None:
        self.room = room
        self.view = view
        self.backdrop: Backdrop = paint_backdrop(room, view)

    def draw_visible_people(self, poses: Sequence[Pose], outfits: Sequence[Outfit]) -> list[DrawnPerson]:
        """Draw the people who may be visible, farthest first."""
        drawn = []
        for walker, (pose, outfit) in enumerate(zip(poses, outfits, strict=True)):
            beyond = self.room.signed_distance_outside(pose.x, pose.y)
            if beyond > _THRESHOLD and not self._near_door(pose):
                continue
            skeleton = place_joints(pose, outfit.height)
            light = _LIGHT_GAIN * float(
                surface_style(self.room).light(self.room, np.array(pose.x), np.array(pose.y))
            )
            figure = draw_figure(self.view, build_body(outfit), skeleton, light)
            if figure is None or clip_to_image(figure, self.view) is None:
                continue
            drawn.append(
                DrawnPerson(walker, skeleton, figure, beyond < 0, self._visible_mask(figure, pose, beyond))
            )
        center = self.view.center
        return sorted(
            drawn, key=lambda person: -float(np.hypot(*(person.joints[:, :2].mean(axis=0) - center[:2])))
        )

    def _near_door(self, pose: Pose) -> bool:
        return any(
            abs((pose.x if door.wall == "north" else pose.y) - door.start - door.width / 2) < _OUT_OF_DOOR
            and ((pose.y > self.room.depth) == (door.wall == "north"))
            for door in self.room.doors
        )

    def _visible_mask(self, figure: Figure, pose: Pose, beyond: float) -> Bytes | None:
        part = clip_to_image(figure, self.view)
        if part is None:
            return None
        masks = [
            mask[part.area]
            for piece, mask in zip(self.room.furniture, self.backdrop.furniture, strict=True)
            if self._hides(piece, pose)
        ]
        masks = [mask for mask in masks if mask.any()]
        if not masks and beyond <= _THRESHOLD:
            return None
        if beyond > _THRESHOLD:
            visible = self.backdrop.doors[0 if pose.y > self.room.depth else 1][part.area].copy()
        else:
            visible = np.full(masks[0].shape, 255, dtype=np.uint8)
        for mask in masks:
            visible = np.asarray(cv2.subtract(visible, mask), dtype=np.uint8)
        return visible

    def _hides(self, piece: Furniture, pose: Pose) -> bool:
        """Return whether furniture can hide a person: not if the camera is beyond the same side of it.

        Seen from straight above, furniture hides no standing person.
        """
        if self.view.looks_straight_down:
            return False
        west, south, east, north = piece.footprint
        x, y = self.view.center[:2].tolist()
        same_side = (
            (x <= west and pose.x <= west)
            or (x >= east and pose.x >= east)
            or (y <= south and pose.y <= south)
            or (y >= north and pose.y >= north)
        )
        return not same_side
