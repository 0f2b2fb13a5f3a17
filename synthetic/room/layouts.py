"""The rooms of the scenes `room`, `gallery` and `overhead`: size, doors, furniture and cameras, in meters."""

from __future__ import annotations

from synthetic.cameras.pinhole import Viewpoint
from synthetic.room.furniture import bench, desk, pillar, plant, sideboard, sofa, table
from synthetic.room.room import Door, Room

ROOM = Room(
    width=11.0,
    depth=8.0,
    height=3.4,
    doors=(Door("north", 7.75), Door("east", 5.45)),
    # Along the walls and below the cameras, away from the routes; only the pillar is inside the room.
    furniture=(
        pillar(5.6, 6.0, 3.4),
        bench(4.75, 0.45),
        sofa(0.08, 2.95),
        sideboard(10.54, 2.3),
        plant(0.6, 0.6),
        plant(10.4, 0.6),
        plant(0.6, 7.4),
        plant(10.4, 7.4),
    ),
    rug=(3.7, 2.35, 7.3, 4.75),
    # Corners first: with two or three cameras the doorways are far from all of them, and visible in two.
    viewpoints=(
        Viewpoint((0.35, 0.35, 3.0), (5.6, 4.75, 0.45)),
        Viewpoint((10.65, 0.35, 3.0), (5.4, 4.75, 0.45)),
        Viewpoint((0.35, 7.65, 3.0), (5.6, 3.25, 0.45)),
        Viewpoint((10.65, 7.65, 3.0), (5.4, 3.25, 0.45)),
        Viewpoint((5.5, 0.25, 3.1), (5.5, 5.2, 0.45)),
        Viewpoint((2.9, 7.75, 3.1), (4.3, 2.8, 0.45)),
        Viewpoint((0.25, 4.0, 3.0), (6.0, 4.0, 0.45)),
        Viewpoint((10.75, 4.6, 3.0), (5.0, 3.9, 0.45)),
    ),
)

_GALLERY_FIELD = 58.0  # degrees: eight meters at the far wall
_GALLERY_SPACING = 12.0  # meters from one camera to the next

GALLERY = Room(
    width=34.0,
    depth=7.0,
    height=3.4,
    doors=(Door("north", 10.4), Door("east", 2.9)),
    furniture=(bench(10.2, 0.4), bench(22.3, 0.4), plant(0.6, 6.4), plant(22.8, 6.4), plant(33.4, 6.4)),
    rug=(13.5, 2.3, 20.5, 4.7),
    viewpoints=tuple(
        Viewpoint(
            (5.0 + _GALLERY_SPACING * number, 0.35, 3.1),
            (5.0 + _GALLERY_SPACING * number, 4.6, 0.45),
            _GALLERY_FIELD,
        )
        for number in range(3)
    ),
)

_OVERHEAD_WIDTH, _OVERHEAD_DEPTH = 7.0, 5.0  # meters
_OVERHEAD_HEIGHT = 6.0  # meters: the floor then fills a 16:9 image
_OVERHEAD_FIELD = 77.0  # degrees

OVERHEAD_AREA = (1.0, 1.0, 6.0, 4.0)  # west, south, east and north bound of the area without furniture


OVERHEAD = Room(
    width=_OVERHEAD_WIDTH,
    depth=_OVERHEAD_DEPTH,
    height=_OVERHEAD_HEIGHT + 0.4,
    doors=(),
    furniture=(
        sofa(0.06, 1.45),
        table(0.62, 0.62),
        sideboard(6.5, 1.6),
        desk(2.2, 4.33),
        plant(0.5, 4.45),
        plant(6.5, 4.5),
        plant(6.5, 0.5),
    ),
    rug=(2.1, 1.45, 4.9, 3.55),
    viewpoints=(
        Viewpoint(
            (_OVERHEAD_WIDTH / 2, _OVERHEAD_DEPTH / 2, _OVERHEAD_HEIGHT),
            (_OVERHEAD_WIDTH / 2, _OVERHEAD_DEPTH / 2, 0.0),
            _OVERHEAD_FIELD,
        ),
        Viewpoint(
            (_OVERHEAD_WIDTH / 2 + 1.0, _OVERHEAD_DEPTH / 2, _OVERHEAD_HEIGHT),
            (_OVERHEAD_WIDTH / 2 + 1.0, _OVERHEAD_DEPTH / 2, 0.0),
            _OVERHEAD_FIELD,
        ),
    ),
)
