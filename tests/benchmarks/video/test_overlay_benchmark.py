"""The overlay benchmark on a real render worker."""

from __future__ import annotations

import asyncio

import pytest

from benchmarks.overlay import RoomStream, ViewerLoad, measure
from server.config.sections import EncodeSettings, SiteSettings


@pytest.mark.slow
def test_the_cost_of_boxes_does_not_grow_with_viewers() -> None:
    room = RoomStream(SiteSettings(width=320, height=180), EncodeSettings())
    plain, one, many = (
        asyncio.run(measure(room, load, 4))
        for load in (ViewerLoad("plain"), ViewerLoad("one", 1), ViewerLoad("many", 10))
    )
    assert 0 < plain.worker_ms < one.worker_ms
    assert many.worker_ms < 4 * one.worker_ms, "not ten times as much"
    assert plain.megabytes > 10
    assert plain.start_s > 0
