"""Fragments for the render worker, and the pictures in them."""

from __future__ import annotations

from functools import cache

import av
import numpy as np

from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH, encoded
from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.h264.annexb import join_sample
from server.media.nal_units import nal_units
from server.media.rendering_messages import RenderSettings
from server.service.rendering.worker.box_overlay import Image

RENDER_SETTINGS = RenderSettings(
    width=WIDTH, height=HEIGHT, fps=FPS, gop=GOP, preset="ultrafast", crf=18, max_kbps=None, jpeg_quality=90
)  # fmt: skip


def fragments(first: int, count: int, seed: int = 0) -> bytes:
    """Return a camera's frames as the fragments of its stream."""
    units = encoded(seed)[first : first + count]
    return b"".join(
        fragment([FragmentSample(join_sample(nal_units(unit.data)), unit.key)], unit.pulse, FPS)
        for unit in units
    )


@cache
def decoded_frames(seed: int) -> list[Image]:
    """Return a camera's decoded frames."""
    decoder = av.VideoCodecContext.create("h264", "r")
    pictures = [picture for unit in encoded(seed) for picture in decoder.decode(av.Packet(unit.data))]
    return [np.asarray(picture.to_ndarray(format="bgr24"), np.uint8) for picture in pictures]
