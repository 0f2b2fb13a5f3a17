"""Areas and lines know where points are."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from server.rules import Area, Line

SQUARE = Area("till", ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)))
HORSESHOE = Area("shelf", ((0, 0), (6, 0), (6, 4), (4, 4), (4, 2), (2, 2), (2, 4), (0, 4)))
places = st.floats(-10, 10)
points = st.tuples(places, places)


def winding_number(corners: tuple[tuple[float, float], ...], point: tuple[float, float]) -> int:
    """Sum the angles under which the edges are seen: another way to find what is inside."""
    angles = [math.atan2(y - point[1], x - point[0]) for x, y in corners]
    turned = sum(
        math.remainder(after - before, math.tau)
        for before, after in zip(angles, [*angles[1:], angles[0]], strict=True)
    )
    return round(turned / math.tau)


@given(points)
def test_depth_is_positive_exactly_inside(point: tuple[float, float]) -> None:
    for area in (SQUARE, HORSESHOE):
        assume(abs(area.depth(point)) > 1e-6)
        assert (area.depth(point) > 0) == (winding_number(area.corners, point) != 0)


@given(points, points)
def test_depth_changes_no_faster_than_the_point_moves(
    one: tuple[float, float], other: tuple[float, float]
) -> None:
    assert abs(HORSESHOE.depth(one) - HORSESHOE.depth(other)) <= math.dist(one, other) + 1e-9


@given(st.permutations(range(4)).filter(lambda order: order in ([0, 1, 2, 3], [3, 2, 1, 0])), points)
def test_the_sense_of_rotation_of_the_corners_does_not_matter(
    order: list[int], point: tuple[float, float]
) -> None:
    turned = Area("till", tuple(SQUARE.corners[corner] for corner in order))
    assert turned.depth(point) == pytest.approx(SQUARE.depth(point))


@given(points, points, points, points, points)
def test_a_step_crosses_a_line_between_its_ends_only(
    one: tuple[float, float],
    other: tuple[float, float],
    inner: tuple[float, float],
    start: tuple[float, float],
    end: tuple[float, float],
) -> None:
    assume(math.dist(one, other) > 0.1 and math.dist(start, end) > 0.1)
    line = Line("door", (one, other), inner)
    assume(abs(line.depth(inner)) > 0.1)
    assert line.depth(inner) > 0
    # Where the step and the infinite line meet, solved as two equations.
    (x1, y1), (x2, y2) = one, other
    across = (x2 - x1) * (end[1] - start[1]) - (y2 - y1) * (end[0] - start[0])
    assume(abs(across) > 1e-3)
    along = ((start[0] - x1) * (end[1] - start[1]) - (start[1] - y1) * (end[0] - start[0])) / across
    moved = ((start[0] - x1) * (y2 - y1) - (start[1] - y1) * (x2 - x1)) / across
    assume(all(abs(share - edge) > 1e-6 for share in (along, moved) for edge in (0, 1)))
    assert line.crossed_by(start, end) == (0 < along < 1 and 0 < moved < 1)
