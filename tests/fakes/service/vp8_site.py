"""A served VP8 site with cuts that a test feeds with messages."""

from __future__ import annotations

from collections.abc import AsyncIterator

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL, encoded

EPOCHS = 8
"""The epochs for which a scripted camera has frames."""


@pytest.fixture
async def vp8_site() -> AsyncIterator[ServedSite]:
    """A site of VP8; its person is larger in the other camera every GOP, so there are cuts."""
    changes = {"codec": "vp8"}
    async for served in serve_site(patience=60, encode=changes, http={"viewer_queue_gops": 100}):
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            feed(served, epoch)
        yield served


def feed(served: ServedSite, epoch: int) -> None:
    sizes = (SMALL, LARGE) if epoch % 4 < 2 else (LARGE, SMALL)
    served.service.feed(epoch, {camera: {1: size} for camera, size in zip((A, B), sizes, strict=True)})


def decoded_alone(camera: int) -> list[NDArray[np.uint8]]:
    decoder = av.CodecContext.create("vp8", "r")
    units = encoded(camera, codec="vp8")
    return [
        frame.to_ndarray(format="yuv420p") for unit in units for frame in decoder.decode(av.Packet(unit.data))
    ]
