"""The scenes by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from synthetic.court.court import COURT, HALL
from synthetic.court.game import Game
from synthetic.drawing.clothing import casual, outfit, shirt
from synthetic.overhead.studio import FREE, OVERHEAD
from synthetic.room.gallery import GALLERY
from synthetic.room.hall import Hall
from synthetic.room.room import ROOM, Room
from synthetic.tank import VIEWPOINTS, Tank
from synthetic.walking.gatherings import Gatherings
from synthetic.walking.mingling import Mingle
from synthetic.walking.walkers import Walkers
from synthetic.world import Asked, World

_CROWD = 64  # people in a room, at most


@dataclass(frozen=True, slots=True)
class Entry:
    """One scene: how much of it there is, and what makes its world."""

    about: str
    cameras: int  # where nobody says how many
    most_cameras: int
    objects: int  # where nobody says how many
    most_objects: int
    world: Callable[[Asked], World]


def scene_names() -> tuple[str, ...]:
    """Give the names that `Scene` knows."""
    return tuple(_SCENES)


def scene_entry(name: str) -> Entry:
    """Give what is known of a scene.

    Raises:
        ValueError: where no scene has that name.
    """
    if name not in _SCENES:
        raise ValueError(f"there is no scene {name!r}; there are: {', '.join(_SCENES)}")
    return _SCENES[name]


def _visited(room: Room) -> Callable[[Asked], World]:
    def build(asked: Asked) -> World:
        outfits = [outfit(walker, asked.seed) for walker in range(asked.objects)]
        return Hall(room, Walkers(room, asked.objects, asked.seed), outfits, asked)

    return build


def _overhead(asked: Asked) -> World:
    outfits = [casual(walker, asked.seed) for walker in range(asked.objects)]
    company = Mingle(Gatherings(FREE, asked.objects, asked.seed), [worn.height for worn in outfits])
    return Hall(OVERHEAD, company, outfits, asked)


def _court(asked: Asked) -> World:
    game = Game(COURT, asked.objects, asked.seed)
    outfits = [shirt(player, game.team(player)) for player in range(asked.objects)]
    return Hall(HALL, Mingle(game, [worn.height for worn in outfits]), outfits, asked)


_SCENES = {
    "room": Entry("people come and go in a room", 3, len(ROOM.viewpoints), 4, _CROWD, _visited(ROOM)),
    "gallery": Entry(
        "a long room whose cameras have no floor in common",
        3,
        len(GALLERY.viewpoints),
        4,
        _CROWD,
        _visited(GALLERY),
    ),
    "overhead": Entry(
        "people meet, stand together and part, seen from straight above",
        1,
        len(OVERHEAD.viewpoints),
        3,
        8,
        _overhead,
    ),
    "court": Entry("two teams play on a court", 4, len(HALL.viewpoints), 10, 16, _court),
    "fish": Entry("fish that all look the same in a murky tank", 1, len(VIEWPOINTS), 9, 16, Tank),
}
