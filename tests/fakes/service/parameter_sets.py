"""Cameras whose H.264 parameter sets differ."""

from __future__ import annotations

from functools import cache
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from fakes.service.fed_site import A, B
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, NO_REASON, WIDTH
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.view_selection.decider import GopDecision, ObjectChoice

GOPS = 12
OWN_PARAMETERS = {"encode": {"parameters": "own"}}
ENCODINGS: dict[str, dict[str, Any]] = {A: {"preset": "ultrafast"}, B: {"preset": "medium", "crf": 30}}
"""CAVLC without and CABAC with the rest of profile High: as different as cameras of two makers."""
LOST_GOPS = {(B, 3), (A, 6), (A, 7), (B, 10)}
"""GOPs that are lost."""


@cache
def sent_units(camera: str) -> tuple[AccessUnit, ...]:
    encoder = Encoder(
        SiteSettings(width=WIDTH, height=HEIGHT, fps=FPS),
        EncodeSettings(gop_s=GOP / FPS, **ENCODINGS[camera]),
    )
    rng = np.random.default_rng(sum(camera.encode()))
    coarse = rng.integers(0, 255, (GOPS * GOP, HEIGHT // 8, WIDTH // 8, 3), dtype=np.uint8)
    return tuple(
        encoder.encode(pulse, picture.repeat(8, axis=0).repeat(8, axis=1))
        for pulse, picture in enumerate(coarse)
    )


def decoded_alone(camera: str) -> list[NDArray[np.uint8]]:
    decoder = av.CodecContext.create("h264", "r")
    packets = [*(av.Packet(unit.data) for unit in sent_units(camera)), None]
    return [frame.to_ndarray(format="yuv420p") for packet in packets for frame in decoder.decode(packet)]


def shown_gop(gop: int) -> tuple[str, int]:
    """Return the camera and the GOP whose picture is shown in a GOP."""
    camera = (A, B)[gop % 2]
    return (camera, gop) if (camera, gop) not in LOST_GOPS else shown_gop(gop - 1)


def expected_pictures() -> list[NDArray[np.uint8]]:
    """Return the expected pictures: in place of a lost GOP, the last picture before it."""
    decoded, pictures = {camera: decoded_alone(camera) for camera in ENCODINGS}, []
    for gop in range(GOPS):
        camera, source_gop = shown_gop(gop)
        pictures += [
            decoded[camera][gop * GOP + n] if source_gop == gop else pictures[-1] for n in range(GOP)
        ]
    return pictures


def put_frames(frame_buffers: dict[str, FrameBuffer]) -> None:
    for camera, frame_buffer in frame_buffers.items():
        for unit in sent_units(camera):
            if (camera, unit.pulse // GOP) not in LOST_GOPS:
                frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)


def decision(gop: int) -> GopDecision:
    choice = ObjectChoice(1, (A, B)[gop % 2], None, departed=False)
    return GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON)
