"""A person's stream is the chosen cameras' own bytes, GOP by GOP, for as long as anybody knows them."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from fakes.cameras import CAMERAS, FPS, GOP, NO_REASON, encoded, small_config
from fakes.decisions import choice
from fakes.timeouts import PATIENCE
from server.media.stream_format import Agreement
from server.service.streaming.broadcaster import Subscriber
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.view_selection.decider import GopDecision, ObjectChoice

A, B = CAMERAS


def filled() -> tuple[Splicer, dict[str, FrameBuffer]]:
    agreement = Agreement()
    shelves = {camera: FrameBuffer(FPS, 40, agreement) for camera in CAMERAS}
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed):
            shelves[camera].put(unit.pulse, 1, unit.data, key=unit.key)
    return Splicer(shelves, agreement, small_config()), shelves


def decision(
    gop: int, *choices: ObjectChoice, merged: dict[int, int] | None = None, frames: int = GOP
) -> GopDecision:
    return GopDecision(gop * GOP, frames, choices, {}, merged or {}, (), NO_REASON)


async def received(viewer: Subscriber) -> list[bytes]:
    viewer.close()
    async with asyncio.timeout(PATIENCE):
        return [data async for data in viewer]


def gops(shelves: dict[str, FrameBuffer], cameras: Iterable[str], first: int = 0) -> list[bytes]:
    return [shelves[camera].gop((first + place) * GOP, GOP) for place, camera in enumerate(cameras)]


async def test_a_stream_is_the_chosen_cameras_bytes() -> None:
    splicer, shelves = filled()
    splicer.decision(decision(0, choice(1, A)))
    viewer = splicer.objects[1].join()
    for gop, camera in enumerate([B, A, A], start=1):
        splicer.decision(decision(gop, choice(1, camera)))
    assert await received(viewer) == gops(shelves, [A, B, A, A])


async def test_people_shown_by_one_camera_share_the_bytes() -> None:
    splicer, _ = filled()
    splicer.decision(decision(0, choice(1, A), choice(2, A)))
    one, two = (splicer.objects[number].join() for number in (1, 2))
    assert (await received(one))[0] is (await received(two))[0]


async def test_where_nobody_can_be_shown_the_camera_from_before_goes_on() -> None:
    splicer, shelves = filled()
    splicer.decision(decision(0, choice(1, A)))
    viewer = splicer.objects[1].join()
    splicer.decision(decision(1, choice(1, None)))
    splicer.decision(decision(2, choice(1, B)))
    assert await received(viewer) == gops(shelves, [A, A, B])


async def test_a_partial_gop_at_the_end_is_sent() -> None:
    splicer, shelves = filled()
    splicer.decision(decision(0, choice(1, A), frames=3))
    assert await received(splicer.objects[1].join()) == [shelves[A].gop(0, 3)]


async def test_the_stream_of_a_number_that_was_anothers_goes_on_with_that_person() -> None:
    splicer, shelves = filled()
    splicer.decision(decision(0, choice(1, A), choice(2, B)))
    viewer = splicer.objects[2].join()
    splicer.decision(decision(1, choice(1, A), merged={2: 1}))
    splicer.decision(decision(2, choice(1, None), merged={2: 1}))
    splicer.decision(decision(3, choice(1, B), merged={2: 1}))
    splicer.forget({1}, {2: 1})
    assert await received(viewer) == gops(shelves, [B, A, A, B])


async def test_the_stream_of_a_number_that_was_anothers_ends_when_nobody_watches_it_any_more() -> None:
    splicer, _ = filled()
    splicer.decision(decision(0, choice(1, A), choice(2, B), choice(3, B)))
    viewer = splicer.objects[2].join()
    splicer.decision(decision(1, choice(1, A), merged={2: 1, 3: 1}))
    splicer.forget({1}, {2: 1, 3: 1})
    assert list(splicer.objects) == [1, 2], "nobody watched 3: who asks for it now is given 1"
    splicer.objects[2].leave(viewer)
    splicer.forget({1}, {2: 1, 3: 1})
    assert list(splicer.objects) == [1]


async def test_the_streams_of_the_forgotten_end() -> None:
    splicer, shelves = filled()
    splicer.decision(decision(0, choice(1, A), choice(2, B)))
    viewer = splicer.objects[2].join()
    splicer.forget({1}, [])
    async with asyncio.timeout(PATIENCE):
        assert [data async for data in viewer] == gops(shelves, [B])
    assert list(splicer.objects) == [1]


async def test_a_cameras_own_stream_begins_with_a_key_frame_and_is_every_frame() -> None:
    splicer, shelves = filled()
    early = splicer.cameras[A].join()
    frames = [shelved for pulse in range(2, 13) if (shelved := shelves[A].get(pulse)) is not None]
    for frame in frames:
        splicer.frame(A, frame)
    late = splicer.cameras[A].join()
    assert splicer.viewers == 2
    assert await received(early) == [frame.fragment for frame in frames[3:]], "from pulse 5 on"
    assert await received(late) == [frame.fragment for frame in frames[8:]], "from pulse 10 on"


async def test_the_end_ends_every_stream() -> None:
    splicer, _ = filled()
    splicer.decision(decision(0, choice(1, A)))
    viewers = [splicer.objects[1].join(), splicer.cameras[A].join()]
    splicer.close()
    async with asyncio.timeout(PATIENCE):
        assert [len([data async for data in viewer]) for viewer in viewers] == [1, 0]
