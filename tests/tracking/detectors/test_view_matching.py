"""A camera that was turned is found again by what both of its pictures show."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tracking.detectors import BackgroundDetector, BackgroundSettings, FloorGeometry
from tracking.detectors.background.views.known_views import KnownViews
from tracking.detectors.background.views.turn_finder import TurnFinder
from tracking.detectors.background.views.view_matching import find_view

SIZE = (360, 240)
FOCAL = 320.0


def panorama() -> np.ndarray:
    """Return a wide scene with things of all sizes, 1200 x 600."""
    random = np.random.default_rng(5)
    scene = np.full((600, 1200, 3), 120, dtype=np.uint8)
    for _ in range(700):
        x, y, w, h = (random.random(4) * (1200, 600, 60, 60)).astype(int).tolist()
        cv2.rectangle(scene, (x, y), (x + 4 + w, y + 4 + h), random.integers(20, 235, 3).tolist(), -1)
    return scene


SCENE = panorama()
CAMERA = np.array([[FOCAL, 0.0, SIZE[0] / 2], [0.0, FOCAL, SIZE[1] / 2], [0.0, 0.0, 1.0]])
ON_SCENE = np.array([[1.0, 0.0, 600.0 - SIZE[0] / 2], [0.0, 1.0, 300.0 - SIZE[1] / 2], [0.0, 0.0, 1.0]])


def turn(pan: float, tilt: float) -> np.ndarray:
    """Return the homography of a camera that is turned by so many degrees."""
    rotation, _ = cv2.Rodrigues(np.radians([tilt, pan, 0.0]))
    found = CAMERA @ rotation @ np.linalg.inv(CAMERA)
    return np.asarray(found / found[2, 2])


def view(pan: float = 0.0, tilt: float = 0.0, noise: int = 0) -> np.ndarray:
    """Return what the camera shows."""
    seen = cv2.warpPerspective(SCENE, turn(pan, tilt) @ np.linalg.inv(ON_SCENE), SIZE)
    random = np.random.default_rng(noise)
    return np.asarray(np.clip(seen + random.normal(0.0, 3.0, seen.shape), 0, 255), dtype=np.uint8)


def largest_error(found: np.ndarray, pan: float, tilt: float) -> float:
    """Return the largest error in what both views show, pixels."""
    across, down = np.meshgrid(np.arange(0, SIZE[0], 20.0), np.arange(0, SIZE[1], 20.0))
    points = np.stack([across.ravel(), down.ravel(), np.ones(across.size)])
    true, mapped = turn(pan, tilt) @ points, found @ points
    true, mapped = true[:2] / true[2], mapped[:2] / mapped[2]
    both = ((true >= 0) & (true < np.array(SIZE)[:, None])).all(axis=0)
    return float(np.linalg.norm(true - mapped, axis=0)[both].max())


@pytest.mark.parametrize(("pan", "tilt"), [(3.0, 0.0), (-10.0, 4.0), (22.0, -3.0)])
def test_a_turned_view_is_located(pan: float, tilt: float) -> None:
    found = find_view(view(), view(pan, tilt, noise=1))
    assert found is not None
    assert found.matches > 40
    assert largest_error(found.homography, pan, tilt) < 1.5


def test_another_scene_a_mirrored_and_an_empty_one_are_not_located() -> None:
    random = np.random.default_rng(9)
    other = cv2.resize(random.integers(0, 255, (30, 45, 3), dtype=np.uint8), SIZE)
    for after in (other, view()[:, ::-1].copy(), np.full_like(view(), 100)):
        assert find_view(view(), after) is None
        assert find_view(after, view()) is None


def test_a_clock_in_the_picture_does_not_make_another_scene_the_same() -> None:
    def with_clock(image: np.ndarray) -> np.ndarray:
        picture = image.copy()
        for row, text in ((14, "2026-11-27 19:49:12"), (230, "CAMERA 01 ENTRANCE")):
            cv2.putText(picture, text, (6, row), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1)
        return picture

    scenes = []
    for seed in (1, 2):
        random = np.random.default_rng(seed)
        scene = np.full((SIZE[1], SIZE[0], 3), 110, dtype=np.uint8)
        for x, y, w, h in (random.random((8, 4)) * (*SIZE, 70, 70)).astype(int).tolist():
            cv2.rectangle(scene, (x, y), (x + 8 + w, y + 8 + h), random.integers(20, 235, 3).tolist(), -1)
        scenes.append(with_clock(scene))
    assert find_view(*scenes) is not None, "without a wrong match the test proves nothing"
    known = KnownViews()
    known.leave(scenes[0])
    known.locate(scenes[1])
    assert known.homography is None
    known.locate(np.clip(0.7 * scenes[0] + 20.0, 0.0, 255.0).astype(np.uint8))
    assert known.homography == pytest.approx(np.eye(3), abs=0.5)


def test_a_view_is_located_by_the_one_before_it() -> None:
    """The third view shows nothing of the first."""
    known = KnownViews()
    assert known.homography == pytest.approx(np.eye(3))
    known.leave(view())
    assert known.homography is None
    known.locate(view(25.0))
    known.leave(view(25.0))
    assert find_view(view(), view(50.0)) is None
    known.locate(view(50.0))
    assert known.homography is not None
    middle = known.homography @ np.linalg.inv(turn(50.0, 0.0)) @ [SIZE[0] / 2, SIZE[1] / 2, 1.0]
    assert middle[:2] / middle[2] == pytest.approx([SIZE[0] / 2, SIZE[1] / 2], abs=4.0)
    expected = known.last_turned()
    assert expected is not None
    shared = expected.max(axis=2) > 0
    assert 0.2 < shared.mean() < 0.8
    assert np.abs(expected.astype(float) - view(50.0))[shared].mean() < 25.0
    known.go_back(view(50.0))
    assert known.homography is not None
    assert largest_error(known.homography, 25.0, 0.0) < 1.5


def noticed(images: list[np.ndarray], agreement: float) -> int | None:
    """Return the first of the frames in which it is said that the camera was turned."""
    finder, before = TurnFinder(25.0), view()
    return next((at for at, image in enumerate(images) if finder.find(agreement, before, image)), None)


def test_a_turn_is_noticed_once_the_camera_rests() -> None:
    turning = [view(min(frame, 30) * 0.5, noise=frame) for frame in range(75)]
    assert noticed(turning, agreement=0.9) is None, "nothing is wrong with the background"
    at = noticed(turning, agreement=0.3)
    assert at is not None
    assert 30 <= at <= 60


def test_a_camera_that_stays_and_one_in_fog_are_not_turned() -> None:
    fog = np.clip(0.3 * view() + 150.0, 0.0, 255.0).astype(np.uint8)
    for image in (view(noise=3), fog, np.full_like(view(), 90)):
        assert noticed([image] * 75, agreement=0.3) is None


def test_what_a_turned_camera_ignores_and_its_horizon_move_along() -> None:
    detector = BackgroundDetector(
        BackgroundSettings(ignore=(((0.0, 0.0), (90.0, 0.0), (90.0, 239.0), (0.0, 239.0)),)),
        FloorGeometry(horizon=20.0, slope=None),
        fps=10.0,
    )
    for frame in range(30):
        detector.detect(view(noise=frame))
    assert detector.grid.visible[:, :88].max() == 0
    for frame in range(60):
        detector.detect(view(20.0, noise=100 + frame))
    moved = detector.camera_motion
    assert moved is not None
    assert largest_error(moved, 20.0, 0.0) < 3.0
    corner = moved @ [90.0, 120.0, 1.0]
    edge = round(corner[0] / corner[2])
    assert 150 < edge < 300
    assert detector.grid.visible[120, edge - 6] == 0
    assert detector.grid.visible[120, edge + 6 :].min() == 255


def test_the_horizon_is_where_it_was_in_the_scene() -> None:
    level = FloorGeometry(horizon=SIZE[1] / 2, slope=0.4)
    assert level.turned(turn(20.0, 0.0), SIZE[0]).horizon == pytest.approx(SIZE[1] / 2)
    tilted = level.turned(turn(0.0, 5.0), SIZE[0])
    assert abs(tilted.horizon - SIZE[1] / 2) == pytest.approx(FOCAL * np.tan(np.radians(5.0)))
    assert tilted.slope == 0.4
