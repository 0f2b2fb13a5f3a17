"""The surface styles of rooms: floor, walls and light."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from synthetic.cameras.pinhole import Floats
from synthetic.court import gym_surfaces
from synthetic.room import house_surfaces
from synthetic.room.room import Room, StyleName


class SurfaceStyle(Protocol):
    """The surfaces of one style of room; colors are red, green, blue in 0..1."""

    def light(self, room: Room, x: Floats, y: Floats, /) -> Floats:
        """Return the brightness of floor points."""

    def floor(self, room: Room, points: Floats, /) -> Floats:
        """Return the colors of points ``(N, 3)`` of the floor."""

    def ceiling(self, points: Floats, /) -> Floats:
        """Return the colors of points ``(N, 3)`` of the ceiling."""

    def wall(self, room: Room, points: Floats, axis: int, /, *, far: bool) -> Floats:
        """Return the colors of points ``(N, 3)`` of a wall across an axis; ``far``: the farther of two."""


_STYLES: Mapping[StyleName, SurfaceStyle] = {"house": house_surfaces, "court": gym_surfaces}


def surface_style(room: Room) -> SurfaceStyle:
    """Return the style of a room."""
    return _STYLES[room.style]


def surface_color(room: Room, points: Floats, axis: int, *, upper: bool) -> Floats:
    """Return the colors of points ``(N, 3)`` of a surface across an axis; ``upper``: the farther."""
    style = surface_style(room)
    if axis == 2:  # noqa: PLR2004 — the z axis
        return style.ceiling(points) if upper else style.floor(room, points)
    return style.wall(room, points, axis, far=upper)
