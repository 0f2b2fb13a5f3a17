"""A stream with a preferred camera shows it while it sees the person, else the best view."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    NO_REASON,
    encoded,
    joined_fragments,
    small_config,
)
from fakes.timeouts import PATIENCE
from server.media.stream_format import StreamFormat
from server.messaging.messages import NumberedBox
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.streaming.subscriber_queue import Subscriber
from server.service.view_selection.decider import GopDecision, ObjectChoice

A, B = CAMERAS


class Site:
    """Two cameras without losses; a test decides whether the first one sees the person, GOP by GOP."""

    def __init__(self) -> None:
        stream_format = StreamFormat()
        self.frame_buffers = {camera: FrameBuffer(FPS, 40, stream_format) for camera in CAMERAS}
        for seed, camera in enumerate(CAMERAS):
            for unit in encoded(seed):
                self.frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)
        self.splicer = Splicer(self.frame_buffers, stream_format, small_config())
        self.gops = 0

    def decide(self, frames_seen: int, number: int = 1, merged: dict[int, int] | None = None) -> None:
        """Decide a GOP: B is best, and A sees the person in its first frames."""
        visible_gops: list[list[NumberedBox]] = [
            [(number, 1.0, 1.0, 9.0, 9.0)] if frame < frames_seen else [] for frame in range(GOP)
        ]
        choices = () if merged and 1 in merged else (ObjectChoice(1, B, B, departed=False),)
        choices += (ObjectChoice(2, B, B, departed=False),)
        boxes = {A: visible_gops, B: [[] for _ in visible_gops]}
        decision = GopDecision(self.gops * GOP, GOP, choices, boxes, merged or {}, (), NO_REASON)
        self.splicer.publish_decision(decision)
        self.gops += 1

    async def cameras(self, viewer: Subscriber) -> str:
        """Return the cameras that were shown, a letter for each GOP."""
        viewer.close()
        async with asyncio.timeout(PATIENCE):
            sent = [data async for data in viewer]
        first = self.gops - len(sent)
        return "".join(
            next(
                camera
                for camera in CAMERAS
                if joined_fragments(self.frame_buffers[camera], (first + at) * GOP, GOP) == data
            )[1]
            for at, data in enumerate(sent)
        )


@pytest.mark.parametrize(
    ("visible_gops", "shown"),
    [
        ([5, 5, 5, 5], "0000"),
        ([5, 5, 0, 5, 5], "00110"),
        ([0, 5, 5, 5], "1100"),
        ([3, 3, 2, 3, 3], "00110"),
        ([5, 0, 5, 0, 5], "01111"),
    ],
)
async def test_a_preferred_camera_is_shown_while_it_sees_the_person(
    visible_gops: Sequence[int], shown: str
) -> None:
    site = Site()
    site.decide(visible_gops[0])
    viewer = site.splicer.preferred.broadcaster(1, A).subscribe()
    for frames in visible_gops[1:]:
        site.decide(frames)
    assert await site.cameras(viewer) == shown


async def test_other_streams_are_unchanged() -> None:
    site = Site()
    site.decide(GOP)
    preferring, other = (
        site.splicer.preferred.broadcaster(1, A).subscribe(),
        site.splicer.persons[1].subscribe(),
    )
    site.decide(GOP)
    assert site.splicer.viewers == 2
    assert (await site.cameras(preferring), await site.cameras(other)) == ("00", "11")


async def test_viewers_with_one_preference_share_a_stream_that_ends_with_the_last_of_them() -> None:
    site = Site()
    site.decide(GOP)
    channel = site.splicer.preferred.broadcaster(1, A)
    viewers = [channel.subscribe(), channel.subscribe()]
    assert site.splicer.preferred.broadcaster(1, A) is channel
    for viewer in viewers:
        site.decide(GOP)
        assert site.splicer.preferred.broadcaster(1, A) is channel
        channel.unsubscribe(viewer)
    site.decide(GOP)
    assert site.splicer.preferred.broadcaster(1, A) is not channel


async def test_the_stream_of_a_merged_person_continues_with_the_kept_one() -> None:
    site = Site()
    site.decide(GOP)
    viewer = site.splicer.preferred.broadcaster(1, A).subscribe()
    site.decide(GOP, number=2, merged={1: 2})
    site.decide(GOP, number=2, merged={1: 2})
    site.splicer.forget({1, 2}, [])
    assert await site.cameras(viewer) == "000"


async def test_the_stream_of_a_forgotten_person_ends() -> None:
    site = Site()
    site.decide(GOP)
    viewer = site.splicer.preferred.broadcaster(1, A).subscribe()
    site.splicer.forget({2}, [])
    async with asyncio.timeout(PATIENCE):
        assert len([data async for data in viewer]) == 1
