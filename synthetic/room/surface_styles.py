"""Which floor, walls and light a room has: the one place that knows what styles there are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from synthetic.cameras.pinhole import Floats
from synthetic.court import gym_surfaces
from synthetic.room import house_surfaces
from synthetic.room.room import Room, Style


class Finish(Protocol):
    """How a style of room looks: colours are red, green, blue in 0..1."""

    def light(self, room: Room, x: Floats, y: Floats, /) -> Floats:
        """Say how bright floor points are."""

    def floor(self, room: Room, points: Floats, /) -> Floats:
        """Colour the points ``(N, 3)`` of the floor."""

    def ceiling(self, points: Floats, /) -> Floats:
        """Colour the points ``(N, 3)`` of the ceiling."""

    def wall(self, room: Room, points: Floats, axis: int, /, *, far: bool) -> Floats:
        """Colour the points ``(N, 3)`` of a wall across an axis; ``far`` is the farther of the two."""


_FINISHES: Mapping[Style, Finish] = {"house": house_surfaces, "court": gym_surfaces}


def finish_of(room: Room) -> Finish:
    """Give how a room looks."""
    return _FINISHES[room.style]


def surface(room: Room, points: Floats, axis: int, *, upper: bool) -> Floats:
    """Colour the points ``(N, 3)`` of a surface across an axis; ``upper`` is the farther of the two."""
    finish = finish_of(room)
    if axis == 2:  # noqa: PLR2004 — the z axis
        return finish.ceiling(points) if upper else finish.floor(room, points)
    return finish.wall(room, points, axis, far=upper)
