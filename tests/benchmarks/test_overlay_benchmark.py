"""The overlay benchmark on a real render worker."""

from __future__ import annotations

import asyncio

from benchmarks.overlay import RoomStream, ViewerLoad, measure
from server.config.sections import EncodeSettings, SiteSettings


def test_boxes_cost_more_than_no_boxes_and_no_more_for_another_viewer() -> None:
    room = RoomStream(SiteSettings(width=320, height=180), EncodeSettings())
    nothing, one, more = (
        asyncio.run(measure(room, load, 4))
        for load in (ViewerLoad("nothing"), ViewerLoad("one", 1), ViewerLoad("more", 10))
    )
    assert 0 < nothing.worker_ms < one.worker_ms
    assert more.worker_ms < 4 * one.worker_ms, "not ten times as much"
    assert nothing.megabytes > 10
    assert nothing.start_s > 0
