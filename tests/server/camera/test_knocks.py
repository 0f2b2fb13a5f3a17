"""A camera that was knocked says so once, and what it sends matches the floor as before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from server.camera.knocks import KnockLog, motion_message, noticeable
from server.camera.pipeline import CameraPipeline
from server.camera.sources import Image, SourceEndedError
from server.cli.render.camera_workers import run_camera
from server.config.loader import build_config
from tracking.detectors.background.motion import STILL, Motion

SIZE = (320, 180)
KNOCK = Motion(5.0, -3.0, turn=0.0175)
KNOCKED_FROM, FRAMES = 60, 150


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
    assert Motion(found.x, found.y, found.grow, found.turn).distance(KNOCK, SIZE) < 0.5


def test_a_motion_that_changes_no_position_on_the_floor_is_not_reported() -> None:
    assert motion_message(noticeable(Motion(0.5, 0.5), SIZE)) is None
    assert motion_message(noticeable(KNOCK, SIZE)) is not None


def test_a_knock_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    log = KnockLog("c1")
    began = [log.update(motion_message(motion)) for motion in (STILL, KNOCK, Motion(5.5, -3.0), STILL)]
    assert began == [False, True, False, False]
    assert [record.getMessage() for record in caplog.records] == [
        "camera c1: it has moved by 6 pixels and 1.0 degrees; floor positions are corrected",
        "camera c1 is where it was",
    ]
