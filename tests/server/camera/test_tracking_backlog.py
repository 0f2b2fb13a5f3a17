"""Frames that waited for too long are not searched: all later tracks would come too late."""

from __future__ import annotations

import asyncio

import numpy as np

from server.camera.captured_frame import CapturedFrame
from server.camera.tracking_backlog import TrackingBacklog

OLDEST_S = 2.0


def frame_of(pulse: int) -> CapturedFrame:
    return CapturedFrame(pulse, np.zeros((2, 2, 3), dtype=np.uint8), None)


async def backlog_with(*ages_s: float) -> list[bool]:
    """Return, frame by frame, whether frames whose pulses were so long ago are outdated as they are got."""
    backlog, now = TrackingBacklog(10, OLDEST_S), asyncio.get_running_loop().time()
    for pulse, age_s in enumerate(ages_s):
        backlog.put(pulse, frame_of(pulse), now - age_s)
    outdated = []
    for _ in ages_s:
        frame = await backlog.get()
        assert frame is not None
        outdated.append(backlog.is_outdated(frame))
    return outdated


async def test_frames_are_searched_while_the_service_waits_for_their_tracks() -> None:
    assert await backlog_with(9.0, 2.1, -100.0, -200.0) == [True, True, False, False]


async def test_the_newest_frame_is_searched_however_late_it_is() -> None:
    assert await backlog_with(9.0, 8.0, 7.0) == [True, True, False]


async def test_a_frame_that_finds_no_room_counts_as_skipped() -> None:
    backlog = TrackingBacklog(1, OLDEST_S)
    assert [backlog.put(pulse, frame_of(pulse), 0.0) for pulse in range(2)] == [False, True]
    waiting = [await backlog.get() for _ in range(2)]
    found = [(frame.frame is not None, frame.skipped) for frame in waiting if frame is not None]
    assert found == [(True, False), (False, True)]
