"""People are tracked in the picture of the substream that was captured with the one that viewers see."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from fakes.media.two_streams import (
    FPS,
    FRAMES,
    GOP,
    MAIN,
    SUB,
    TwoStreamCamera,
    walker_box,
    walker_frame,
    walker_gops,
)
from fakes.timeouts import PATIENCE
from server.camera.captured_frame import CapturedFrame
from server.camera.pipeline import CameraPipeline, DetectedFrame
from server.camera.substream.live_substream import LiveSubstream
from server.camera.substream.picture_buffer import PictureBuffer
from server.config.loader import build_config
from server.config.site_config import Config
from server.media.color_conversion import to_bgr
from server.media.h264.continuity import PictureContinuity

QUICK = {"rtsp_transport": "tcp", "probesize": "20000", "analyzeduration": "200000"}


def site(camera: TwoStreamCamera, **changes: Any) -> Config:
    content = {
        "site": {"fps": FPS, "width": MAIN[0], "height": MAIN[1]},
        "encode": {"gop_s": GOP / FPS, "parameters": "own"},
        "cameras": [
            {"id": "c0", "source": camera.main.url, "substream": camera.sub.url, "options": QUICK, **changes}
        ],
    }
    return build_config(content, where="walk", folder=Path())


@contextmanager
def running(camera: TwoStreamCamera, **changes: Any) -> Iterator[Pulses]:
    """Run a camera's pipeline."""
    try:
        pipeline = CameraPipeline(site(camera, **changes), "c0")
        yield Pulses(pipeline)
        pipeline.close()
    finally:
        camera.close()


class Pulses:
    """Takes frames at the pulses, in real time, detects people in them, and decodes what viewers get."""

    def __init__(self, pipeline: CameraPipeline) -> None:
        self.pipeline, self._pulse = pipeline, 0
        self._began = time.monotonic()
        self._decoder = av.VideoCodecContext.create("h264", "r")

    def next(self) -> tuple[CapturedFrame, DetectedFrame, float]:
        """Return the next frame, what was detected in it, and the number of the frame that viewers see."""
        end = time.monotonic() + PATIENCE
        while True:
            assert time.monotonic() < end, "no frames"
            time.sleep(max(0.0, self._began + self._pulse / FPS - time.monotonic()))
            self._pulse += 1
            frame = self.pipeline.take(self._pulse)
            if frame is not None:
                break
        unit = self.pipeline.encode(frame.pulse, frame)
        if unit.key:
            self._decoder = av.VideoCodecContext.create("h264", "r")
        picture = self._decoder.decode(av.Packet(unit.data))[-1]
        shown = walker_frame(picture.to_ndarray(format="bgr24"))
        return frame, self.pipeline.detect(frame.pulse, frame), shown

    def until(self, condition: Callable[[CapturedFrame, DetectedFrame], bool]) -> None:
        """Run until a condition holds."""
        end = time.monotonic() + PATIENCE
        while not condition(*self.next()[:2]):
            assert time.monotonic() < end

    def differences(self, count: int) -> list[float]:
        """Return by how many frames the tracked pictures are later than what viewers see."""
        found: list[float] = []
        for _ in range(count):
            _, detected, shown = self.next()
            assert detected.image is not None
            later = walker_frame(detected.image) - shown
            found.append((later + FRAMES / 2) % FRAMES - FRAMES / 2)
        return found


@pytest.mark.parametrize(
    ("passthrough", "main_delay_s", "sub_delay_s"),
    [("off", 0.0, 0.15), ("pass", 0.0, 0.2), ("pass", 0.3, 0.0)],
)
def test_boxes_lie_on_the_person_that_viewers_see_at_different_delays(
    passthrough: str, main_delay_s: float, sub_delay_s: float
) -> None:
    camera = TwoStreamCamera(main_delay_s=main_delay_s, sub_delay_s=sub_delay_s)
    with running(camera, passthrough=passthrough) as pulses:
        assert pulses.pipeline.is_passthrough == (passthrough == "pass")
        assert pulses.pipeline.tracked.scale.tracked == SUB
        for _ in range(FPS):
            pulses.next()  # the first report arrives, the background is learned
        assert np.median(np.abs(pulses.differences(FPS))) < 0.5
        near = []
        for _ in range(FPS):
            _, detected, shown = pulses.next()
            left, _, right, _ = walker_box(shown)
            boxes = detected.detections.boxes
            near.append(bool(np.any(np.abs(boxes[:, 0] + boxes[:, 2] - left - right) < 2 * 8)))
        assert np.mean(near) > 0.8, "0.15 s are 11 pixels"
        assert pulses.pipeline.tracked.state == "live"


def test_without_reports_pictures_are_paired_by_their_arrival() -> None:
    with running(TwoStreamCamera(main_delay_s=0.1, sub_delay_s=0.1, reports=False)) as pulses:
        pulses.differences(FPS)
        assert np.median(np.abs(pulses.differences(FPS))) <= 1


def test_the_cameras_clock_tells_when_a_picture_was_captured() -> None:
    camera = TwoStreamCamera(sub_delay_s=0.2)
    pictures = PictureBuffer(5.0, 0.02)
    reader = LiveSubstream(camera.sub.url, QUICK, pictures)
    try:
        end = time.monotonic() + PATIENCE
        while not (found := [each for each in pictures._pictures if each.captured.camera is not None]):
            assert time.monotonic() < end
            time.sleep(0.02)
        newest = found[-1]
        seconds = (newest.captured.camera or 0.0) - camera.sub.unix_began
        assert seconds * FPS % FRAMES == pytest.approx(walker_frame(to_bgr(newest.picture)), abs=0.5)
        assert newest.captured.arrival - camera.sub.began == pytest.approx(seconds + 0.2, abs=0.1)
    finally:
        reader.close()
        camera.close()


def test_the_main_stream_is_decoded_only_while_the_substream_is_away(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO", "server.camera.substream")
    camera = TwoStreamCamera()
    with running(camera, passthrough="pass") as pulses:
        pulses.until(lambda _, detected: detected.image is not None)
        for _ in range(GOP):
            frame, detected, _ = pulses.next()
            assert frame.image is None, "not decoded"
            assert detected.image is not None
        camera.sub.close()
        pulses.until(lambda frame, detected: frame.image is not None and detected.image is not None)
        assert pulses.pipeline.tracked.state == "away"
        camera.restart_substream()
        pulses.until(lambda frame, detected: frame.image is None and detected.image is not None)
        assert pulses.pipeline.tracked.state == "live"
    assert [text for text in caplog.messages if text.startswith("camera c0")] == [
        "camera c0: its substream delivers no pictures: people are tracked in its source",
        "camera c0: people are tracked in its substream again",
    ]


def test_a_camera_starts_without_its_substream(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.camera.substream.live_substream._FIRST_PICTURE_S", 0.1)
    camera = TwoStreamCamera()
    camera.sub.close()
    with running(camera) as pulses:
        frame, detected, _ = pulses.next()
        assert frame.image is not None
        assert detected.image is not None
        assert pulses.pipeline.tracked.scale.tracked == MAIN
        pulses.until(lambda *_: pulses.pipeline.tracked.state == "away")
        camera.restart_substream()
        pulses.until(lambda *_: pulses.pipeline.tracked.state == "live")


def test_a_lost_picture_is_found_without_decoding() -> None:
    units = [unit for gop in walker_gops(SUB) for unit in gop]
    whole = PictureContinuity()
    assert all(whole.follows(unit.data) for unit in units)
    broken = PictureContinuity()
    follows = [broken.follows(unit.data) for unit in (*units[:4], *units[5 : 2 * GOP])]
    assert follows == [True] * 4 + [False] + [True] * (2 * GOP - 6)
    assert not PictureContinuity().follows(b"\x00\x00\x01\x09\xf0")
    resized = PictureContinuity()
    assert resized.follows(units[0].data)
    assert not resized.follows(walker_gops(MAIN)[0][0].data)
