"""One camera's stage: its view, the empty room, and the figures that stand in it, furthest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, Perspective
from synthetic.drawing.backdrop import Backdrop, paint
from synthetic.drawing.body import body
from synthetic.drawing.clothing import Outfit
from synthetic.drawing.figure import Figure, clip, draw_figure
from synthetic.drawing.skeleton import joints
from synthetic.room.room import Furniture, Room
from synthetic.room.surface_styles import finish_of
from synthetic.walking.stroll import Pose

_THRESHOLD = 0.12  # metres behind the wall from which only the doorway shows a walker
_GONE = 1.6  # metres to the side of a doorway's middle at which nothing of a walker is in it
_FULL = 1.12  # brings clothes to their own colours in the brightest part of the room

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Actor:
    """A walker as one camera sees it."""

    walker: int
    joints: Floats  # (J, 3) metres
    figure: Figure
    inside: bool  # in the room, not in a corridor
    curtain: Bytes | None  # (h, w) of the figure's patch within the picture: share that shows; None: all


class Stage:
    """Everything that one camera needs to draw or judge a frame."""

    def __init__(self, room: Room, view: Perspective) -> None:
        self.room = room
        self.view = view
        self.backdrop: Backdrop = paint(room, view)

    def actors(self, poses: Sequence[Pose], outfits: Sequence[Outfit]) -> list[Actor]:
        """Place the walkers that the camera may see, furthest first."""
        found = []
        for walker, (pose, outfit) in enumerate(zip(poses, outfits, strict=True)):
            beyond = self.room.outside(pose.x, pose.y)
            if beyond > _THRESHOLD and not self._near_door(pose):
                continue
            skeleton = joints(pose, outfit.height)
            light = _FULL * float(finish_of(self.room).light(self.room, np.array(pose.x), np.array(pose.y)))
            figure = draw_figure(self.view, body(outfit), skeleton, light)
            if figure is None or clip(figure, self.view) is None:
                continue
            found.append(Actor(walker, skeleton, figure, beyond < 0, self._curtain(figure, pose, beyond)))
        centre = self.view.centre
        return sorted(
            found, key=lambda actor: -float(np.hypot(*(actor.joints[:, :2].mean(axis=0) - centre[:2])))
        )

    def _near_door(self, pose: Pose) -> bool:
        return any(
            abs((pose.x if door.wall == "north" else pose.y) - door.start - door.width / 2) < _GONE
            and ((pose.y > self.room.depth) == (door.wall == "north"))
            for door in self.room.doors
        )

    def _curtain(self, figure: Figure, pose: Pose, beyond: float) -> Bytes | None:
        part = clip(figure, self.view)
        if part is None:
            return None
        hiding = [
            mask[part.area]
            for piece, mask in zip(self.room.furniture, self.backdrop.furniture, strict=True)
            if self._hides(piece, pose)
        ]
        hiding = [mask for mask in hiding if mask.any()]
        if not hiding and beyond <= _THRESHOLD:
            return None
        if beyond > _THRESHOLD:
            shown = self.backdrop.doors[0 if pose.y > self.room.depth else 1][part.area].copy()
        else:
            shown = np.full(hiding[0].shape, 255, dtype=np.uint8)
        for mask in hiding:
            shown = np.asarray(cv2.subtract(shown, mask), dtype=np.uint8)
        return shown

    def _hides(self, piece: Furniture, pose: Pose) -> bool:
        """Say whether furniture stands before a walker: not if both are beyond the same side of it.

        From straight above all furniture is beside or below who stands.
        """
        if self.view.overhead:
            return False
        west, south, east, north = piece.footprint
        x, y = self.view.centre[:2].tolist()
        apart = (
            (x <= west and pose.x <= west)
            or (x >= east and pose.x >= east)
            or (y <= south and pose.y <= south)
            or (y >= north and pose.y >= north)
        )
        return not apart
