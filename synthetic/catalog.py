"""The scenes by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from synthetic.court.court import COURT, SPORTS_HALL
from synthetic.court.game import Game
from synthetic.drawing.clothing import (
    choose_distinct_outfit,
    choose_outfit_with_lookalikes,
    choose_team_outfit,
)
from synthetic.room.layouts import GALLERY, OVERHEAD, OVERHEAD_AREA, ROOM
from synthetic.room.room import Room
from synthetic.room.room_world import RoomWorld
from synthetic.tank import VIEWPOINTS, TankWorld
from synthetic.walking.choreographed_crowd import ChoreographedCrowd
from synthetic.walking.gatherings import Gatherings
from synthetic.walking.visiting_crowd import VisitingCrowd
from synthetic.world import SceneParameters, World

_CROWD = 64  # most people in a room


@dataclass(frozen=True, slots=True)
class CatalogEntry:
    """One scene: its default and largest numbers of cameras and objects, and how its world is built."""

    description: str
    default_cameras: int
    max_cameras: int
    default_objects: int
    max_objects: int
    build: Callable[[SceneParameters], World]


def scene_names() -> tuple[str, ...]:
    """Return the names that `Scene` accepts."""
    return tuple(_SCENES)


def catalog_entry(name: str) -> CatalogEntry:
    """Return the catalog's entry for a scene.

    Raises:
        ValueError: no scene has that name.
    """
    if name not in _SCENES:
        raise ValueError(f"there is no scene {name!r}; there are: {', '.join(_SCENES)}")
    return _SCENES[name]


# Instances of a scene share its visitors, whose routes take seconds to plan.
_visitors = lru_cache(maxsize=8)(VisitingCrowd)


def _visited(room: Room) -> Callable[[SceneParameters], World]:
    def build(parameters: SceneParameters) -> World:
        outfits = [choose_distinct_outfit(walker, parameters.seed) for walker in range(parameters.objects)]
        return RoomWorld(room, _visitors(room, parameters.objects, parameters.seed), outfits, parameters)

    return build


def _overhead(parameters: SceneParameters) -> World:
    outfits = [choose_outfit_with_lookalikes(walker, parameters.seed) for walker in range(parameters.objects)]
    crowd = ChoreographedCrowd(
        Gatherings(OVERHEAD_AREA, parameters.objects, parameters.seed), [outfit.height for outfit in outfits]
    )
    return RoomWorld(OVERHEAD, crowd, outfits, parameters)


def _court(parameters: SceneParameters) -> World:
    game = Game(COURT, parameters.objects, parameters.seed)
    outfits = [choose_team_outfit(player, game.team(player)) for player in range(parameters.objects)]
    return RoomWorld(
        SPORTS_HALL, ChoreographedCrowd(game, [outfit.height for outfit in outfits]), outfits, parameters
    )


_SCENES = {
    "room": CatalogEntry("people come and go in a room", 3, len(ROOM.viewpoints), 4, _CROWD, _visited(ROOM)),
    "gallery": CatalogEntry(
        "a long room whose cameras share no floor area",
        3,
        len(GALLERY.viewpoints),
        4,
        _CROWD,
        _visited(GALLERY),
    ),
    "overhead": CatalogEntry(
        "people meet, stand together and part, seen from straight above",
        1,
        len(OVERHEAD.viewpoints),
        3,
        8,
        _overhead,
    ),
    "court": CatalogEntry("two teams play on a court", 4, len(SPORTS_HALL.viewpoints), 10, 16, _court),
    "fish": CatalogEntry(
        "fish of identical appearance in a murky tank", 1, len(VIEWPOINTS), 9, 16, TankWorld
    ),
}
