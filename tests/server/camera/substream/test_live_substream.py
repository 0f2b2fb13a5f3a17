"""People are tracked in the picture of the substream that was captured with the one that viewers see."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from fakes.media.two_streams import FPS, FRAMES, GOP, MAIN, SUB, TwoStreamCamera, walker_frame
from fakes.timeouts import PATIENCE
from server.camera.captured_frame import CapturedFrame
from server.camera.pipeline import CameraPipeline
from server.camera.sources.base import Image
from server.config.loader import build_config
from server.config.site_config import Config

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


class Pulses:
    """Takes frames at the pulses, in real time, and the pictures that they are tracked in."""

    def __init__(self, pipeline: CameraPipeline) -> None:
        self.pipeline, self.pulse = pipeline, 0
        self._began = time.monotonic()
        self._decoder = av.VideoCodecContext.create("h264", "r")

    def next(self) -> tuple[CapturedFrame, Image | None, float] | None:
        """Return the next frame, its tracked picture, and the number of the frame that viewers see."""
        time.sleep(max(0.0, self._began + self.pulse / FPS - time.monotonic()))
        frame = self.pipeline.take(self.pulse)
        self.pulse += 1
        if frame is None:
            return None
        unit = self.pipeline.encode(frame.pulse, frame)
        if unit.key:
            self._decoder = av.VideoCodecContext.create("h264", "r")
        pictures = self._decoder.decode(av.Packet(unit.data))
        shown = walker_frame(pictures[-1].to_ndarray(format="bgr24"))
        return frame, self.pipeline.tracked.image(frame), shown

    def differences(self, count: int) -> list[float]:
        """Return by how many frames the tracked picture is later than what viewers see."""
        found: list[float] = []
        end = time.monotonic() + PATIENCE
        while len(found) < count:
            assert time.monotonic() < end, "not enough frames were tracked in the substream"
            taken = self.next()
            if taken is not None and taken[1] is not None and taken[1].shape[1::-1] == SUB:
                behind = walker_frame(taken[1]) - taken[2]
                found.append((behind + FRAMES / 2) % FRAMES - FRAMES / 2)
        return found


@pytest.mark.parametrize("passthrough", ["off", "pass"])
@pytest.mark.parametrize(("main_delay_s", "sub_delay_s"), [(0.0, 0.3), (0.3, 0.0)])
def test_boxes_lie_on_the_person_at_different_delays(
    passthrough: str, main_delay_s: float, sub_delay_s: float
) -> None:
    camera = TwoStreamCamera(main_delay_s=main_delay_s, sub_delay_s=sub_delay_s)
    try:
        pipeline = CameraPipeline(site(camera, passthrough=passthrough), "c0")
        assert pipeline.is_passthrough == (passthrough == "pass")
        differences = Pulses(pipeline).differences(4 * FPS)
        pipeline.close()
    finally:
        camera.close()
    assert abs(np.median(differences)) < 0.5
    assert np.mean(np.abs(differences) < 0.5) > 0.9
