"""A person's stream is the chosen cameras' own bytes, GOP by GOP, until the person is forgotten."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from fakes.service.decisions import choice
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
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.streaming.subscriber_queue import Subscriber
from server.service.view_selection.decider import GopDecision, ObjectChoice

A, B = CAMERAS


def filled() -> tuple[Splicer, dict[str, FrameBuffer]]:
    stream_format = StreamFormat()
    frame_buffers = {camera: FrameBuffer(FPS, 40, stream_format) for camera in CAMERAS}
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed):
            frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)
    return Splicer(frame_buffers, stream_format, small_config()), frame_buffers


def decision(
    gop: int, *choices: ObjectChoice, merged: dict[int, int] | None = None, frames: int = GOP
) -> GopDecision:
    return GopDecision(gop * GOP, frames, choices, {}, merged or {}, (), NO_REASON)


async def received(viewer: Subscriber) -> list[bytes]:
    viewer.close()
    async with asyncio.timeout(PATIENCE):
        return [data async for data in viewer]


def gops(frame_buffers: dict[str, FrameBuffer], cameras: Iterable[str], first: int = 0) -> list[bytes]:
    return [
        joined_fragments(frame_buffers[camera], (first + place) * GOP, GOP)
        for place, camera in enumerate(cameras)
    ]


async def test_a_stream_is_the_chosen_cameras_bytes() -> None:
    splicer, frame_buffers = filled()
    splicer.publish_decision(decision(0, choice(1, A)))
    viewer = splicer.persons[1].subscribe()
    for gop, camera in enumerate([B, A, A], start=1):
        splicer.publish_decision(decision(gop, choice(1, camera)))
    assert await received(viewer) == gops(frame_buffers, [A, B, A, A])


async def test_people_shown_by_one_camera_share_the_bytes() -> None:
    splicer, _ = filled()
    splicer.publish_decision(decision(0, choice(1, A), choice(2, A)))
    one, two = (splicer.persons[number].subscribe() for number in (1, 2))
    assert (await received(one))[0] is (await received(two))[0]


async def test_without_a_choice_the_last_camera_continues() -> None:
    splicer, frame_buffers = filled()
    splicer.publish_decision(decision(0, choice(1, A)))
    viewer = splicer.persons[1].subscribe()
    splicer.publish_decision(decision(1, choice(1, None)))
    splicer.publish_decision(decision(2, choice(1, B)))
    assert await received(viewer) == gops(frame_buffers, [A, A, B])


async def test_a_partial_gop_at_the_end_is_sent() -> None:
    splicer, frame_buffers = filled()
    splicer.publish_decision(decision(0, choice(1, A), frames=3))
    assert await received(splicer.persons[1].subscribe()) == [joined_fragments(frame_buffers[A], 0, 3)]


async def test_the_stream_of_a_merged_number_continues_with_the_kept_person() -> None:
    splicer, frame_buffers = filled()
    splicer.publish_decision(decision(0, choice(1, A), choice(2, B)))
    viewer = splicer.persons[2].subscribe()
    splicer.publish_decision(decision(1, choice(1, A), merged={2: 1}))
    splicer.publish_decision(decision(2, choice(1, None), merged={2: 1}))
    splicer.publish_decision(decision(3, choice(1, B), merged={2: 1}))
    splicer.forget({1}, {2: 1})
    assert await received(viewer) == gops(frame_buffers, [B, A, A, B])


async def test_the_stream_of_a_merged_number_ends_with_its_last_viewer() -> None:
    splicer, _ = filled()
    splicer.publish_decision(decision(0, choice(1, A), choice(2, B), choice(3, B)))
    viewer = splicer.persons[2].subscribe()
    splicer.publish_decision(decision(1, choice(1, A), merged={2: 1, 3: 1}))
    splicer.forget({1}, {2: 1, 3: 1})
    assert list(splicer.persons) == [1, 2], "3 had no viewers: later ones receive 1"
    splicer.persons[2].unsubscribe(viewer)
    splicer.forget({1}, {2: 1, 3: 1})
    assert list(splicer.persons) == [1]


async def test_the_streams_of_forgotten_persons_end() -> None:
    splicer, frame_buffers = filled()
    splicer.publish_decision(decision(0, choice(1, A), choice(2, B)))
    viewer = splicer.persons[2].subscribe()
    splicer.forget({1}, [])
    async with asyncio.timeout(PATIENCE):
        assert [data async for data in viewer] == gops(frame_buffers, [B])
    assert list(splicer.persons) == [1]


async def test_a_cameras_own_stream_begins_with_a_keyframe_and_has_every_frame() -> None:
    splicer, frame_buffers = filled()
    early = splicer.cameras[A].subscribe()
    frames = [frame for pulse in range(2, 13) if (frame := frame_buffers[A].get(pulse)) is not None]
    for frame in frames:
        splicer.publish_frame(A, frame)
    late = splicer.cameras[A].subscribe()
    assert splicer.viewers == 2
    assert await received(early) == [frame.fragment for frame in frames[3:]], "from pulse 5 on"
    assert await received(late) == [frame.fragment for frame in frames[8:]], "from pulse 10 on"


async def test_closing_the_splicer_ends_every_stream() -> None:
    splicer, _ = filled()
    splicer.publish_decision(decision(0, choice(1, A)))
    viewers = [splicer.persons[1].subscribe(), splicer.cameras[A].subscribe()]
    splicer.close()
    async with asyncio.timeout(PATIENCE):
        assert [len([data async for data in viewer]) for viewer in viewers] == [1, 0]
