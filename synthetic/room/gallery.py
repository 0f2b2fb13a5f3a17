"""The gallery: a long room under cameras that look across it and have no floor in common.

Between what two of them show are four metres of floor that nobody sees: who is seen by one camera, and a
while later by the next, has to be told by looks and by the time that the way takes.
"""

from __future__ import annotations

from synthetic.cameras.pinhole import Viewpoint
from synthetic.room.room import Door, Room, bench, plant

_FIELD = 58.0  # degrees: eight metres at the far wall
_APART = 12.0  # metres from one camera to the next

GALLERY = Room(
    width=34.0,
    depth=7.0,
    height=3.4,
    doors=(Door("north", 10.4), Door("east", 2.9)),
    furniture=(bench(10.2, 0.4), bench(22.3, 0.4), plant(0.6, 6.4), plant(22.8, 6.4), plant(33.4, 6.4)),
    rug=(13.5, 2.3, 20.5, 4.7),
    viewpoints=tuple(
        Viewpoint((5.0 + _APART * number, 0.35, 3.1), (5.0 + _APART * number, 4.6, 0.45), _FIELD)
        for number in range(3)
    ),
)
