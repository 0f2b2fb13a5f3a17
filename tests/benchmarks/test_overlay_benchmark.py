"""The benchmark of pictures measures a real process, and what is not wanted costs less."""

from __future__ import annotations

import asyncio

from benchmarks.overlay import RoomStream, ViewerLoad, measure
from server.config.sections import EncodeSettings, SiteSettings


def test_boxes_cost_more_than_no_boxes_and_no_more_for_another_viewer() -> None:
    stage = RoomStream(SiteSettings(width=320, height=180), EncodeSettings())
    nothing, one, more = (
        asyncio.run(measure(stage, wish, 4))
        for wish in (ViewerLoad("nothing"), ViewerLoad("one", 1), ViewerLoad("more", 10))
    )
    assert 0 < nothing.drawing < one.drawing
    assert more.drawing < 4 * one.drawing, "not ten times as much"
    assert nothing.megabytes > 10
    assert nothing.start_s > 0
