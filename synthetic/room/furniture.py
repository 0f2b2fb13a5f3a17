"""Furniture of the rooms, built of blocks; lengths in meters."""

from __future__ import annotations

from synthetic.room.room import Block, Furniture

_PLASTER = (0.74, 0.72, 0.69)
_OAK = (0.40, 0.29, 0.20)
_LEAF = ((0.20, 0.33, 0.20), (0.24, 0.40, 0.23), (0.17, 0.29, 0.19))


def bench(west: float, south: float) -> Furniture:
    """Return a bench along the southern wall, by its south-western corner."""
    legs = (0.10, 1.32)
    return Furniture(
        "bench",
        (
            Block((west, south, 0.38), (west + 1.5, south + 0.42, 0.45), _OAK),
            *(
                Block(
                    (west + at, south + 0.05, 0.0), (west + at + 0.08, south + 0.37, 0.38), (0.16, 0.16, 0.17)
                )
                for at in legs
            ),
        ),
    )


def plant(x: float, y: float) -> Furniture:
    """Return a plant in a pot, by its middle."""
    balls = ((0, 0, 1.0, 0.30), (0.17, 0.06, 0.82, 0.22), (-0.16, 0.1, 0.86, 0.23), (0.02, -0.17, 0.8, 0.22))
    leaves = tuple(
        Block(
            (x + dx - r, y + dy - r, z - r),
            (x + dx + r, y + dy + r, z + r * 1.25),
            _LEAF[index % len(_LEAF)],
            "ball",
        )
        for index, (dx, dy, z, r) in enumerate(balls)
    )
    pot = Block((x - 0.2, y - 0.2, 0.0), (x + 0.2, y + 0.2, 0.5), (0.66, 0.62, 0.57), "cylinder")
    return Furniture("plant", (pot, *leaves))


def sofa(west: float, south: float) -> Furniture:
    """Return a sofa along the western wall, by its south-western corner."""
    cloth, cushion = (0.25, 0.31, 0.38), (0.30, 0.37, 0.44)
    return Furniture(
        "sofa",
        (
            Block((west, south, 0.08), (west + 0.85, south + 2.1, 0.30), cloth),
            Block((west, south, 0.30), (west + 0.22, south + 2.1, 0.82), cloth),
            Block((west, south, 0.30), (west + 0.85, south + 0.2, 0.58), cloth),
            Block((west, south + 1.9, 0.30), (west + 0.85, south + 2.1, 0.58), cloth),
            Block((west + 0.22, south + 0.22, 0.30), (west + 0.83, south + 1.04, 0.44), cushion),
            Block((west + 0.22, south + 1.06, 0.30), (west + 0.83, south + 1.88, 0.44), cushion),
        ),
    )


def sideboard(west: float, south: float) -> Furniture:
    """Return a sideboard along the eastern wall, by its south-western corner."""
    doors = tuple(
        Block(
            (west - 0.015, south + 0.03 + 0.6 * k, 0.16),
            (west, south + 0.57 + 0.6 * k, 0.72),
            (0.47, 0.35, 0.25),
        )
        for k in range(3)
    )
    return Furniture(
        "sideboard", (Block((west, south, 0.12), (west + 0.42, south + 1.8, 0.76), _OAK), *doors)
    )


def pillar(west: float, south: float, height: float) -> Furniture:
    """Return a pillar from floor to ceiling, by its south-western corner."""
    return Furniture(
        "pillar",
        (
            Block((west, south, 0.0), (west + 0.3, south + 0.3, height), _PLASTER),
            Block((west - 0.02, south - 0.02, 0.0), (west + 0.32, south + 0.32, 0.1), (0.5, 0.49, 0.47)),
        ),
    )


def table(x: float, y: float) -> Furniture:
    """Return a low round table with a bowl on it, by its middle."""
    return Furniture(
        "table",
        (
            Block((x - 0.06, y - 0.06, 0.0), (x + 0.06, y + 0.06, 0.4), (0.16, 0.16, 0.17), "cylinder"),
            Block((x - 0.36, y - 0.36, 0.4), (x + 0.36, y + 0.36, 0.44), (0.72, 0.66, 0.56), "cylinder"),
            Block((x - 0.13, y - 0.13, 0.42), (x + 0.13, y + 0.13, 0.56), (0.62, 0.40, 0.28), "ball"),
        ),
    )


def desk(west: float, south: float) -> Furniture:
    """Return a desk along the northern wall with a screen and papers, by its south-western corner."""
    top = 0.74
    return Furniture(
        "desk",
        (
            Block((west, south, top - 0.04), (west + 1.6, south + 0.62, top), (0.46, 0.34, 0.24)),
            Block((west + 0.04, south + 0.05, 0.0), (west + 0.1, south + 0.6, top - 0.04), (0.2, 0.2, 0.21)),
            Block((west + 1.5, south + 0.05, 0.0), (west + 1.56, south + 0.6, top - 0.04), (0.2, 0.2, 0.21)),
            Block(
                (west + 0.55, south + 0.42, top), (west + 1.15, south + 0.46, top + 0.4), (0.1, 0.11, 0.13)
            ),
            Block(
                (west + 0.62, south + 0.12, top), (west + 1.06, south + 0.26, top + 0.02), (0.24, 0.25, 0.27)
            ),
            Block(
                (west + 0.14, south + 0.14, top), (west + 0.35, south + 0.44, top + 0.01), (0.86, 0.85, 0.82)
            ),
        ),
    )
