"""The scenes by name."""

from __future__ import annotations

from server.camera.scene.gallery import GALLERY
from server.camera.scene.room import ROOM, Room

_ROOMS = {"room": ROOM, "gallery": GALLERY}


def scene_names() -> tuple[str, ...]:
    """Give the names that `Scene` knows."""
    return tuple(_ROOMS)


def scene_room(name: str) -> Room:
    """Give the room of a scene.

    Raises:
        ValueError: where no scene has that name.
    """
    if name not in _ROOMS:
        raise ValueError(f"there is no scene {name!r}; there are: {', '.join(_ROOMS)}")
    return _ROOMS[name]
