"""Detections and clear absences in other cameras change scores; places that they cannot see do not."""

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


def camera_at(x: float, y: float, yaw: float) -> CameraGeometry:
    """Return a level camera above (x, y), looking along +Y, turned left by some degrees; meters."""
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


FRONT, SIDE = camera_at(0, 0, 0), camera_at(10, 10, 90)
"""Cameras that look at the floor around (0, 10), from the south and from the east."""
AWAY = camera_at(0, -5, 180)


def boxes_of(camera: CameraGeometry, *places: tuple[float, float]) -> NDArray[np.float64]:
    """Return the boxes of people at these places."""
    foot = from_ground(camera.homography, np.array(places, dtype=np.float64).reshape(-1, 2))
    pixel = np.concatenate([foot - (0.0, 1.0), foot], axis=-1)
    tall = TALL / person_heights(camera.homography, pixel)
    half = 0.19 * tall
    return np.stack([foot[:, 0] - half, foot[:, 1] - tall, foot[:, 0] + half, foot[:, 1]], axis=-1)


def detections_of(
    camera: CameraGeometry, *places: tuple[float, float], score: float = 0.5
) -> CameraDetections:
    boxes = boxes_of(camera, *places)
    return CameraDetections(boxes, np.full(len(boxes), score))


def score_of(
    other: CameraDetections | None, camera: CameraGeometry = SIDE, place: tuple[float, float] = (0, 10)
) -> float:
    """Return the new score of the front camera's box of score 0.5."""
    others = [] if other is None else [(camera, other)]
    [score] = rescore_detections(FRONT, detections_of(FRONT, place), others, DEFAULT)
    return float(score)


def test_a_detection_confirmed_by_another_camera_scores_higher() -> None:
    assert score_of(detections_of(SIDE, (0, 10), score=1.0)) == pytest.approx(
        0.5 + DEFAULT.confirmation_boost * 0.5, abs=0.01
    )
    assert (
        0.5
        < score_of(detections_of(SIDE, (0, 10), score=0.4))
        < score_of(detections_of(SIDE, (0, 10), score=0.8))
    )


def test_a_detection_at_a_clearly_empty_place_scores_lower() -> None:
    assert score_of(detections_of(SIDE)) == pytest.approx(0.5 * (1 - DEFAULT.absence_penalty))
    assert score_of(detections_of(SIDE, (0, 14), score=1.0)) == pytest.approx(
        0.5 * (1 - DEFAULT.absence_penalty), abs=0.02
    )


def test_an_absent_camera_changes_nothing() -> None:
    assert score_of(None) == 0.5


def test_a_camera_without_a_clear_view_lowers_no_score() -> None:
    # A person nearer to it occludes the place.
    assert score_of(detections_of(SIDE, (4, 10))) > score_of(detections_of(SIDE)) + 0.05
    # The floor there is not in its picture.
    assert score_of(detections_of(AWAY), AWAY) == 0.5
    # Detection is off there.
    left, top, right, bottom = boxes_of(SIDE, (0, 10))[0]
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    polygon = np.array(corners) + np.array([[-9, -9], [9, -9], [9, 9], [-9, 9]])
    assert score_of(detections_of(SIDE), replace(SIDE, ignored_regions=(polygon,))) == 0.5
    elsewhere = replace(SIDE, ignored_regions=(polygon + np.array([300.0, 0.0]),))
    assert score_of(detections_of(SIDE), elsewhere) < 0.5


def test_behind_a_cover_there_is_no_evidence_of_absence() -> None:
    cover = boxes_of(SIDE, (0, 10)) + np.array([-9, -9, 9, 9])
    assert score_of(detections_of(SIDE), replace(SIDE, covered=cover)) == 0.5
    assert score_of(detections_of(SIDE), replace(SIDE, covered=cover + np.array([300, 0, 300, 0]))) < 0.5


def test_detections_without_ground_point_are_not_rescored() -> None:
    [left, top, right, _] = boxes_of(FRONT, (0, 10))[0]
    for bottom in (SIZE[1], 200.0):  # cut off by the picture's lower edge, and above the horizon
        own = CameraDetections(np.array([[left, min(top, bottom - 90), right, bottom]]), np.array([0.5]))
        assert rescore_detections(FRONT, own, [(SIDE, detections_of(SIDE))], DEFAULT).tolist() == [0.5]


def test_the_strongest_confirmation_counts() -> None:
    west = camera_at(-10, 10, -90)
    confirming, empty = detections_of(SIDE, (0, 10), score=1.0), detections_of(west)
    [both] = rescore_detections(
        FRONT, detections_of(FRONT, (0, 10)), [(SIDE, confirming), (west, empty)], DEFAULT
    )
    [reordered] = rescore_detections(
        FRONT, detections_of(FRONT, (0, 10)), [(west, empty), (SIDE, confirming)], DEFAULT
    )
    assert both == reordered
    assert score_of(detections_of(SIDE)) < both < score_of(confirming)


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


def reference_score(
    own: CameraGeometry,
    box: NDArray[np.float64],
    score: float,
    others: list[tuple[CameraGeometry, CameraDetections]],
) -> float:
    """Compute the score of one box, point by point."""
    if abs(box[3] / own.size[1] - 1) < 0.01:
        return score
    place = to_ground(own.homography, foot_points(box))
    if np.isnan(place).any():
        return score
    spread = foot_covariance(own.homography, box, DEFAULT.foot_sideways, DEFAULT.foot_upwards)
    height = float(person_heights(own.homography, box))
    confirmation, absence = 0.0, 0.0
    for camera, other_detections in others:
        near = 0.0
        for other, certainty in zip(other_detections.boxes, other_detections.scores, strict=True):
            if abs(other[3] / camera.size[1] - 1) < 0.01:
                continue
            other_spread = foot_covariance(
                camera.homography, other, DEFAULT.foot_sideways, DEFAULT.foot_upwards
            )
            gate_covariance = spread + other_spread + np.eye(2) * (DEFAULT.gate_heights * height) ** 2
            away = place - to_ground(camera.homography, foot_points(other))
            if not np.isnan(away).any():
                near = max(
                    near, float(certainty * np.exp(-0.5 * away @ np.linalg.solve(gate_covariance, away)))
                )
        confirmation = max(confirmation, near)
        foot = from_ground(camera.homography, place)
        if np.isnan(foot).any():
            continue
        pixel = np.array([foot[0], foot[1] - 1, foot[0], foot[1]])
        tall = height / float(person_heights(camera.homography, pixel))
        shown = 0
        for row in range(6):
            for across in (-0.25, 0.0, 0.25):
                x, y = foot[0] + across * 0.38 * tall, foot[1] - (row + 0.5) / 6 * tall
                covered = any(
                    certainty >= DEFAULT.minimum_occluder_score and left <= x <= right and top <= y <= bottom
                    for (left, top, right, bottom), certainty in zip(
                        other_detections.boxes, other_detections.scores, strict=True
                    )
                )
                shown += 0 <= x <= camera.size[0] and 0 <= y <= camera.size[1] and not covered
        share = max((shown / 18 - DEFAULT.clear_view_share) / (1 - DEFAULT.clear_view_share), 0.0)
        absence = max(absence, (1 - near) * share)
    return (
        score
        + DEFAULT.confirmation_boost * confirmation * (1 - score)
        - DEFAULT.absence_penalty * absence * score
    )


PLACE = st.tuples(st.floats(-8, 8), st.floats(3, 16), st.floats(0, 1), st.floats(0.7, 1.4))
PEOPLE = st.lists(PLACE, max_size=4)


def draw_detections(
    camera: CameraGeometry, people: list[tuple[float, float, float, float]]
) -> CameraDetections:
    boxes = boxes_of(camera, *((x, y) for x, y, _, _ in people))
    projected = ~np.isnan(boxes).any(axis=1)
    factors = np.array([factor for *_, factor in people]).reshape(-1)
    boxes[:, 1] = boxes[:, 3] - factors * (boxes[:, 3] - boxes[:, 1])
    return CameraDetections(
        boxes[projected], np.array([score for _, _, score, _ in people]).reshape(-1)[projected]
    )


@settings(deadline=None, max_examples=60)
@given(PEOPLE, PEOPLE, PEOPLE)
def test_rescoring_equals_the_reference(
    own: list[tuple[float, float, float, float]],
    one: list[tuple[float, float, float, float]],
    two: list[tuple[float, float, float, float]],
) -> None:
    corner = camera_at(-8, 2, -45)
    others = [(SIDE, draw_detections(SIDE, one)), (corner, draw_detections(corner, two))]
    detections = draw_detections(FRONT, own)
    scores = rescore_detections(FRONT, detections, others, DEFAULT)
    expected = [
        reference_score(FRONT, box, score, others)
        for box, score in zip(detections.boxes, detections.scores, strict=True)
    ]
    assert scores == pytest.approx(expected, abs=1e-9)
    assert ((scores >= 0) & (scores <= 1)).all()
