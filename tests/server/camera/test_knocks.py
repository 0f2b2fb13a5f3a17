"""A camera that was knocked says so once, and what it sends matches the floor as before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
import pytest

from server.camera.picture_reports import KnockLog, noticeable_motion
from server.camera.pipeline import CameraPipeline
from server.camera.sources import Image, SourceEndedError
from server.camera.substream.picture_scale import PictureScale
from server.camera.view_monitor import ViewMonitor
from server.cli.render.camera_workers import run_camera
from server.config.loader import build_config
from tracking.boxes import areas
from tracking.detectors import BackgroundDetector, Detector, HogDetector
from tracking.detectors.background.motion import STILL, Motion

SIZE = (320, 180)
KNOCK = Motion(5.0, -3.0, turn=0.0175)
KNOCKED_FROM, FRAMES = 60, 150
SCALE = PictureScale(SIZE, SIZE)


class KnockedCamera:
    """A camera of a furnished room that is knocked."""

    size, recorded = SIZE, True

    def __init__(self) -> None:
        random = np.random.default_rng(2)
        self._room = np.full((SIZE[1], SIZE[0], 3), 120, dtype=np.uint8)
        for _ in range(150):
            x, y, w, h = (random.random(4) * (*SIZE, 40, 40)).astype(int).tolist()
            color = random.integers(40, 220, 3).tolist()
            cv2.rectangle(self._room, (x, y), (x + 6 + w, y + 6 + h), color, -1)

    def take(self, pulse: int) -> Image:
        if pulse >= FRAMES:
            raise SourceEndedError
        if pulse < KNOCKED_FROM:
            return self._room
        moved = cv2.warpAffine(self._room, KNOCK.matrix(SIZE), SIZE, borderMode=cv2.BORDER_REFLECT)
        return np.asarray(moved, dtype=np.uint8)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        return (self.take(index) for index in indices if index < KNOCKED_FROM)

    def close(self) -> None:
        """Nothing is open."""


class TurnedCamera:
    """A camera of a furnished hall that is turned within a second and stays so."""

    size, recorded = SIZE, True
    frames = 300

    def __init__(self) -> None:
        random = np.random.default_rng(4)
        self._hall = np.full((400, 900, 3), 120, dtype=np.uint8)
        for _ in range(500):
            x, y, w, h = (random.random(4) * (900, 400, 50, 50)).astype(int).tolist()
            color = random.integers(30, 225, 3).tolist()
            cv2.rectangle(self._hall, (x, y), (x + 4 + w, y + 4 + h), color, -1)
        self.turned = self._turn(22.0)

    @staticmethod
    def _turn(degrees: float) -> np.ndarray:
        lens = np.array([[300.0, 0.0, SIZE[0] / 2], [0.0, 300.0, SIZE[1] / 2], [0.0, 0.0, 1.0]])
        rotation, _ = cv2.Rodrigues(np.radians([0.0, degrees, 0.0]))
        return np.asarray(lens @ rotation @ np.linalg.inv(lens))

    def take(self, pulse: int) -> Image:
        if pulse >= self.frames:
            raise SourceEndedError
        matrix = self._turn(22.0 * float(np.clip((pulse - KNOCKED_FROM) / 25, 0.0, 1.0)))
        place = np.array([[1.0, 0.0, SIZE[0] / 2 - 450], [0.0, 1.0, SIZE[1] / 2 - 200], [0.0, 0.0, 1.0]])
        return np.asarray(cv2.warpPerspective(self._hall, matrix @ place, SIZE), dtype=np.uint8)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        return (self.take(index) for index in indices if index < KNOCKED_FROM)

    def close(self) -> None:
        """Nothing is open."""


def test_track_messages_say_how_the_picture_has_moved() -> None:
    content = {
        "site": {"fps": 25, "width": SIZE[0], "height": SIZE[1]},
        "cameras": [{"id": "c0", "source": "scene:room"}],
    }
    pipeline = CameraPipeline(
        build_config(content, where="site", folder=Path()), "c0", source=KnockedCamera()
    )
    motions = {batch.tracks.last: batch.tracks.motion for batch in run_camera(pipeline, "c0")}
    assert {motion for last, motion in motions.items() if last < KNOCKED_FROM} == {None}
    found = motions[max(motions)]
    assert found is not None
    np.testing.assert_allclose(np.array(found.matrix)[:2, 2], KNOCK.matrix(SIZE)[:, 2], atol=1.0)
    assert (found.pixels, found.degrees) == pytest.approx((np.hypot(5.0, 3.0), 1.0), abs=0.3)


def test_a_turned_camera_is_located_and_its_picture_is_as_good_as_before() -> None:
    """It is turned by 22 degrees: less than half of what it shows was seen before."""
    content = {
        "site": {"fps": 25, "width": SIZE[0], "height": SIZE[1]},
        "cameras": [{"id": "c0", "source": "scene:room"}],
    }
    camera = TurnedCamera()
    pipeline = CameraPipeline(build_config(content, where="site", folder=Path()), "c0", source=camera)
    assert pipeline.view.is_located
    batches = list(run_camera(pipeline, "c0"))
    found = batches[-1].tracks.motion
    assert found is not None
    at = np.array([[60.0, 60.0, 1.0], [100.0, 120.0, 1.0]]).T
    there, true = (matrix @ at for matrix in (np.array(found.matrix), camera.turned))
    np.testing.assert_allclose(there[:2] / there[2], true[:2] / true[2], atol=3.0)
    assert batches[-1].tracks.condition == "clear"
    assert pipeline.view.is_located


@pytest.mark.parametrize("detector", [HogDetector(), BackgroundDetector()])
def test_a_camera_that_is_turned_away_is_not_located_before_its_view_is_found(
    detector: Detector, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A detector may have no background, or one that still explains most of the picture."""
    view, picture = ViewMonitor(10.0, detector, SCALE), KnockedCamera().take(0)
    view.observe(picture, 0)
    assert view.is_located
    monkeypatch.setattr(view.monitor, "shows_another_scene", True)
    view.observe(picture, 1)
    assert not view.is_located


def test_a_camera_whose_lens_is_covered_in_part_is_located_by_the_rest() -> None:
    room, random = KnockedCamera().take(0), np.random.default_rng(0)
    detector = BackgroundDetector()
    view = ViewMonitor(10.0, detector, SCALE)
    shares, reported = [], []
    for frame in range(110):
        picture = np.clip(room + 2.0 * random.standard_normal(room.shape), 0, 255).astype(np.uint8)
        if 50 <= frame < 80:
            picture[:, : SIZE[0] // 2] = (40, 60, 150)
            edge = slice(SIZE[0] // 2 - 10, SIZE[0] // 2 + 10)
            picture[:, edge] = cv2.blur(picture, (21, 1))[:, edge]
        detector.detect(picture)
        view.observe(picture, frame)
        shares.append(areas(view.hidden).sum() / (SIZE[0] * SIZE[1]))
        assert view.is_located
        reported.append(view.covered_share)
        if frame == 75:
            ignored = 1.0 - np.count_nonzero(detector.grid.visible) / detector.grid.visible.size
            assert ignored == pytest.approx(0.5, abs=0.1)
    assert shares[75] == pytest.approx(0.5, abs=0.1)
    assert shares[49] == shares[-1] == 0.0
    assert (reported[60], reported[-1]) == (0.0, 0.0)
    assert max(reported) == pytest.approx(0.5, abs=0.1), "it is reported once it has lasted"


def test_a_partly_covered_lens_that_goes_dark_shows_nothing() -> None:
    room, random = KnockedCamera().take(0), np.random.default_rng(0)
    view, shares = ViewMonitor(5.0, HogDetector(), SCALE), []
    for frame in range(80):
        picture = np.clip(room + 2.0 * random.standard_normal(room.shape), 0, 255).astype(np.uint8)
        if frame >= 25:
            picture[:, : SIZE[0] // 2] = (40, 60, 150)
            edge = slice(SIZE[0] // 2 - 10, SIZE[0] // 2 + 10)
            picture[:, edge] = cv2.blur(picture, (21, 1))[:, edge]
        view.observe(np.full_like(room, 20) if frame >= 50 else picture, frame)
        shares.append(areas(view.hidden).sum() / (SIZE[0] * SIZE[1]))
    assert shares[49] == pytest.approx(0.5, abs=0.1)
    assert (view.condition, shares[-1], view.covered_share) == ("covered", 1.0, 1.0)


def test_a_view_that_is_lost_for_long_without_a_turn_lies_where_it_lay() -> None:
    """A camera that was turned, and then changed to infrared."""
    turned = np.array([[1.0, 0.0, 60.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    detector, room = BackgroundDetector(), KnockedCamera()
    view = ViewMonitor(10.0, detector, SCALE)
    motions, shown = [], []
    for frame in range(100):
        moved = np.eye(3) if frame < 20 else turned if frame < 50 else None
        with patch.object(BackgroundDetector, "camera_motion", moved):
            view.observe(room.take(0), frame)
        motions.append(view.motion)
        shown.append(view.is_located)
    assert motions[10] is None
    assert motions[30] is not None
    assert motions[-1] == motions[30]
    assert (shown[30], shown[60], shown[-1]) == (True, False, True)


def test_a_motion_that_changes_no_position_on_the_floor_is_not_reported() -> None:
    assert noticeable_motion(Motion(0.5, 0.5).homography(SIZE), SIZE) is None
    assert noticeable_motion(KNOCK.homography(SIZE), SIZE) is not None


def test_a_knock_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    log = KnockLog("c1")
    motions = (STILL, KNOCK, Motion(5.5, -3.0), STILL)
    began = [log.update(noticeable_motion(motion.homography(SIZE), SIZE)) for motion in motions]
    assert began == [False, True, False, False]
    assert [record.getMessage() for record in caplog.records] == [
        "camera c1: it has moved by 6 pixels and 1.0 degrees; floor positions are corrected",
        "camera c1 is where it was",
    ]
