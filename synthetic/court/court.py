"""The sports hall: a basketball court under surrounding cameras.

Colors are red, green, blue in 0..1.
"""

from __future__ import annotations

from synthetic.cameras.pinhole import Viewpoint
from synthetic.court.game import Court
from synthetic.room.room import Block, Color, Furniture, Room

_WIDTH, _DEPTH, _HEIGHT = 24.0, 14.5, 7.6  # meters
_FIELD_OF_VIEW = 76.0  # degrees

COURT = Court((2.0, 2.0, 22.0, 12.5), ((3.2, 7.25), (20.8, 7.25)))


_GRAY, _WHITE, _RED = (0.20, 0.22, 0.25), (0.90, 0.91, 0.92), (0.88, 0.34, 0.14)


def _across(ends: tuple[float, float], half: float, heights: tuple[float, float], color: Color) -> Block:
    """Return a box across a basket's axis, from one end to the other along it."""
    middle, (low, high) = COURT.baskets[0][1], heights
    return Block((min(ends), middle - half, low), (max(ends), middle + half, high), color)


def _hoop(board: float, inwards: float) -> tuple[Furniture, Furniture]:
    """Return a basket's post and its board with the hoop; the board faces east where `inwards` is 1."""
    back, rim, middle = board - inwards * 1.9, board + inwards * 0.4, COURT.baskets[0][1]
    post = (
        _across((back - 0.16, back + 0.16), 0.16, (0.0, 3.1), _GRAY),
        _across((back - 0.32, back + 0.32), 0.32, (0.0, 0.9), (0.16, 0.27, 0.50)),
    )
    hung = (
        _across((back + inwards * 0.16, board - inwards * 0.05), 0.07, (3.0, 3.16), _GRAY),
        _across((board - 0.03, board + 0.03), 0.9, (2.9, 3.95), _WHITE),
        _across((board + inwards * 0.031, board + inwards * 0.036), 0.30, (3.05, 3.50), _RED),
        _across((board + inwards * 0.037, board + inwards * 0.040), 0.25, (3.10, 3.45), _WHITE),
        Block((rim - 0.24, middle - 0.24, 3.02), (rim + 0.24, middle + 0.24, 3.06), _RED, "cylinder"),
    )
    return Furniture("post", post), Furniture("board", hung)


def _seats(x: float, y: float) -> Furniture:
    """Return a row of seats along the northern wall, by its south-western corner."""
    legs = tuple(
        Block((x + at, y + 0.05, 0.0), (x + at + 0.08, y + 0.4, 0.40), (0.22, 0.23, 0.25))
        for at in (0.3, 2.1, 3.9)
    )
    return Furniture("seats", (Block((x, y, 0.40), (x + 4.3, y + 0.45, 0.47), (0.62, 0.44, 0.26)), *legs))


SPORTS_HALL = Room(
    width=_WIDTH,
    depth=_DEPTH,
    height=_HEIGHT,
    doors=(),
    furniture=(*_hoop(2.8, 1.0), *_hoop(21.2, -1.0), _seats(4.6, 13.7), _seats(15.1, 13.7)),
    rug=(0.0, 0.0, 0.0, 0.0),
    style="court",
    viewpoints=(
        Viewpoint((0.4, 0.4, 6.2), (10.2, 7.0, 0.0), _FIELD_OF_VIEW),
        Viewpoint((_WIDTH - 0.4, 0.4, 6.2), (13.8, 7.0, 0.0), _FIELD_OF_VIEW),
        Viewpoint((_WIDTH - 0.4, _DEPTH - 0.4, 6.2), (13.8, 7.5, 0.0), _FIELD_OF_VIEW),
        Viewpoint((0.4, _DEPTH - 0.4, 6.2), (10.2, 7.5, 0.0), _FIELD_OF_VIEW),
        Viewpoint((_WIDTH / 2, 0.3, 6.8), (_WIDTH / 2, 6.6, 0.0), 100.0),
        Viewpoint((_WIDTH / 2, _DEPTH - 0.3, 6.8), (_WIDTH / 2, 7.9, 0.0), 100.0),
    ),
)
