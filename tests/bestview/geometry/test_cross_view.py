"""What others see at the same pulse makes a box likelier or less; what they cannot see says nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import CameraDetections, CameraGeometry, CrossViewSettings, rescore_detections, views_overlap
from bestview.geometry.ground_plane import (
    foot_covariance,
    foot_points,
    from_ground,
    person_heights,
    to_ground,
)

SIZE = (640.0, 480.0)
FOCAL, TALL, ABOVE = 400.0, 1.75, 3.0
DEFAULT = CrossViewSettings()


def looking(x: float, y: float, yaw: float) -> CameraGeometry:
    """Return a level camera above (x, y), looking along +Y, turned left by some degrees; metres."""
    turn = math.radians(yaw)
    across, along = (math.cos(turn), math.sin(turn)), (-math.sin(turn), math.cos(turn))
    depth = [along[0], along[1], -(along[0] * x + along[1] * y)]
    sideways = [across[0], across[1], -(across[0] * x + across[1] * y)]
    ground_to_image = np.array(
        [
            [FOCAL * a + SIZE[0] / 2 * b for a, b in zip(sideways, depth, strict=True)],
            [SIZE[1] / 2 * a + FOCAL * ABOVE * b for a, b in zip(depth, (0, 0, 1), strict=True)],
            depth,
        ]
    )
    return CameraGeometry(np.linalg.inv(ground_to_image), SIZE)


FRONT, SIDE = looking(0, 0, 0), looking(10, 10, 90)
"""They look at the floor about (0, 10), the one from the south and the other from the east."""
AWAY = looking(0, -5, 180)


def boxes_of(vantage: CameraGeometry, *places: tuple[float, float]) -> NDArray[np.float64]:
    """Return the boxes of people at these places."""
    foot = from_ground(vantage.homography, np.array(places, dtype=np.float64).reshape(-1, 2))
    pixel = np.concatenate([foot - (0.0, 1.0), foot], axis=-1)
    tall = TALL / person_heights(vantage.homography, pixel)
    half = 0.19 * tall
    return np.stack([foot[:, 0] - half, foot[:, 1] - tall, foot[:, 0] + half, foot[:, 1]], axis=-1)


def found(vantage: CameraGeometry, *places: tuple[float, float], score: float = 0.5) -> CameraDetections:
    boxes = boxes_of(vantage, *places)
    return CameraDetections(boxes, np.full(len(boxes), score))


def score_of(
    other: CameraDetections | None, vantage: CameraGeometry = SIDE, place: tuple[float, float] = (0, 10)
) -> float:
    """Return the new score of the front camera's box of score 0.5."""
    others = [] if other is None else [(vantage, other)]
    [score] = rescore_detections(FRONT, found(FRONT, place), others, DEFAULT)
    return float(score)


def test_a_detection_confirmed_by_another_camera_scores_higher() -> None:
    assert score_of(found(SIDE, (0, 10), score=1.0)) == pytest.approx(
        0.5 + DEFAULT.confirmation_boost * 0.5, abs=0.01
    )
    assert 0.5 < score_of(found(SIDE, (0, 10), score=0.4)) < score_of(found(SIDE, (0, 10), score=0.8))


def test_a_detection_at_a_clearly_empty_place_scores_lower() -> None:
    assert score_of(found(SIDE)) == pytest.approx(0.5 * (1 - DEFAULT.absence_penalty))
    assert score_of(found(SIDE, (0, 14), score=1.0)) == pytest.approx(
        0.5 * (1 - DEFAULT.absence_penalty), abs=0.02
    )


def test_an_absent_camera_changes_nothing() -> None:
    assert score_of(None) == 0.5


def test_a_camera_without_a_clear_view_lowers_no_score() -> None:
    # Somebody nearer to it stands in front.
    assert score_of(found(SIDE, (4, 10))) > score_of(found(SIDE)) + 0.05
    # The floor there is not in its picture.
    assert score_of(found(AWAY), AWAY) == 0.5
    # Nobody is looked for there.
    left, top, right, bottom = boxes_of(SIDE, (0, 10))[0]
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    polygon = np.array(corners) + np.array([[-9, -9], [9, -9], [9, 9], [-9, 9]])
    assert score_of(found(SIDE), replace(SIDE, ignored_regions=(polygon,))) == 0.5
    elsewhere = replace(SIDE, ignored_regions=(polygon + np.array([300.0, 0.0]),))
    assert score_of(found(SIDE), elsewhere) < 0.5


def test_detections_without_ground_point_are_not_rescored() -> None:
    [left, top, right, _] = boxes_of(FRONT, (0, 10))[0]
    for bottom in (SIZE[1], 200.0):  # cut off by the picture's lower edge, and above the horizon
        own = CameraDetections(np.array([[left, min(top, bottom - 90), right, bottom]]), np.array([0.5]))
        assert rescore_detections(FRONT, own, [(SIDE, found(SIDE))], DEFAULT).tolist() == [0.5]


def test_the_surest_other_camera_counts() -> None:
    west = looking(-10, 10, -90)
    here, nobody = found(SIDE, (0, 10), score=1.0), found(west)
    [both] = rescore_detections(FRONT, found(FRONT, (0, 10)), [(SIDE, here), (west, nobody)], DEFAULT)
    [turned] = rescore_detections(FRONT, found(FRONT, (0, 10)), [(west, nobody), (SIDE, here)], DEFAULT)
    assert both == turned
    assert score_of(found(SIDE)) < both < score_of(here)


def test_views_overlap_where_they_see_common_ground() -> None:
    assert views_overlap(FRONT, SIDE)
    assert views_overlap(SIDE, FRONT)
    assert not views_overlap(FRONT, AWAY)
    assert not views_overlap(AWAY, FRONT)


@pytest.mark.parametrize(
    "name", ["confirmation_boost", "absence_penalty", "minimum_occluder_score", "clear_view_share"]
)
@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_shares_outside_0_to_1_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name}: is .* but must be from 0 to 1"):
        CrossViewSettings(**{name: value})


@pytest.mark.parametrize("name", ["gate_heights", "foot_sideways", "foot_upwards"])
@pytest.mark.parametrize("value", [0.0, float("inf"), float("nan")])
def test_lengths_not_above_0_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name}: is .* but must be above 0"):
        CrossViewSettings(**{name: value})


def plainly(
    own: CameraGeometry,
    box: NDArray[np.float64],
    score: float,
    others: list[tuple[CameraGeometry, CameraDetections]],
) -> float:
    """Read the rule for one box, point by point."""
    if abs(box[3] / own.size[1] - 1) < 0.01:
        return score
    place = to_ground(own.homography, foot_points(box))
    if np.isnan(place).any():
        return score
    spread = foot_covariance(own.homography, box, DEFAULT.foot_sideways, DEFAULT.foot_upwards)
    height = float(person_heights(own.homography, box))
    there, nobody = 0.0, 0.0
    for vantage, seen in others:
        near = 0.0
        for other, sure in zip(seen.boxes, seen.scores, strict=True):
            if abs(other[3] / vantage.size[1] - 1) < 0.01:
                continue
            theirs = foot_covariance(vantage.homography, other, DEFAULT.foot_sideways, DEFAULT.foot_upwards)
            about = spread + theirs + np.eye(2) * (DEFAULT.gate_heights * height) ** 2
            away = place - to_ground(vantage.homography, foot_points(other))
            if not np.isnan(away).any():
                near = max(near, float(sure * np.exp(-0.5 * away @ np.linalg.solve(about, away))))
        there = max(there, near)
        foot = from_ground(vantage.homography, place)
        if np.isnan(foot).any():
            continue
        pixel = np.array([foot[0], foot[1] - 1, foot[0], foot[1]])
        tall = height / float(person_heights(vantage.homography, pixel))
        shown = 0
        for row in range(6):
            for across in (-0.25, 0.0, 0.25):
                x, y = foot[0] + across * 0.38 * tall, foot[1] - (row + 0.5) / 6 * tall
                covered = any(
                    sure >= DEFAULT.minimum_occluder_score and left <= x <= right and top <= y <= bottom
                    for (left, top, right, bottom), sure in zip(seen.boxes, seen.scores, strict=True)
                )
                shown += 0 <= x <= vantage.size[0] and 0 <= y <= vantage.size[1] and not covered
        share = max((shown / 18 - DEFAULT.clear_view_share) / (1 - DEFAULT.clear_view_share), 0.0)
        nobody = max(nobody, (1 - near) * share)
    return score + DEFAULT.confirmation_boost * there * (1 - score) - DEFAULT.absence_penalty * nobody * score


PLACE = st.tuples(st.floats(-8, 8), st.floats(3, 16), st.floats(0, 1), st.floats(0.7, 1.4))
PEOPLE = st.lists(PLACE, max_size=4)


def drawn(vantage: CameraGeometry, people: list[tuple[float, float, float, float]]) -> CameraDetections:
    boxes = boxes_of(vantage, *((x, y) for x, y, _, _ in people))
    there = ~np.isnan(boxes).any(axis=1)
    factors = np.array([factor for *_, factor in people]).reshape(-1)
    boxes[:, 1] = boxes[:, 3] - factors * (boxes[:, 3] - boxes[:, 1])
    return CameraDetections(boxes[there], np.array([score for _, _, score, _ in people]).reshape(-1)[there])


@settings(deadline=None, max_examples=60)
@given(PEOPLE, PEOPLE, PEOPLE)
def test_rescoring_equals_the_reference(
    own: list[tuple[float, float, float, float]],
    one: list[tuple[float, float, float, float]],
    two: list[tuple[float, float, float, float]],
) -> None:
    corner = looking(-8, 2, -45)
    others = [(SIDE, drawn(SIDE, one)), (corner, drawn(corner, two))]
    mine = drawn(FRONT, own)
    scores = rescore_detections(FRONT, mine, others, DEFAULT)
    read = [plainly(FRONT, box, score, others) for box, score in zip(mine.boxes, mine.scores, strict=True)]
    assert scores == pytest.approx(read, abs=1e-9)
    assert ((scores >= 0) & (scores <= 1)).all()
