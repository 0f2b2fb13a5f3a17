"""Streams to pictures, without a process around: every frame is itself, damage stays where it is."""

from __future__ import annotations

import asyncio
import io
import subprocess
import sys
from pathlib import Path

import cv2
import msgspec
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.rendering import CANVAS, fragments, shown
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH
from fakes.timeouts import PATIENCE
from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.rendering_messages import READY, RenderRequest, RenderResult, encode_message, is_in_series
from server.service.rendering.decided_boxes import first_pulse
from server.service.rendering.worker.__main__ import serve
from server.service.rendering.worker.box_overlay import CHOSEN_COLOR, OTHER_COLOR, Image, draw_boxes
from server.service.rendering.worker.demuxers import demux_mp4
from server.service.rendering.worker.stream_renderer import StreamRenderer
from server.service.rendering.worker_process import RenderWorker

rates = st.floats(0.1, 60)


def far(jpeg: bytes, image: Image) -> float:
    picture = np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))
    return float(np.abs(picture.astype(np.int16) - image).mean())


@given(rates, st.integers(0, 10**6), st.sampled_from([10.0, 12.5, 25.0, 30.0]))
def test_a_series_has_as_many_pictures_as_its_rate_says(rate: float, first: int, fps: float) -> None:
    seconds = 40
    count = sum(is_in_series(pulse, rate, fps) for pulse in range(first, first + round(seconds * fps)))
    assert abs(count - seconds * min(rate, fps)) <= 1.01


@given(st.sampled_from([1.0, 2.5, 5.0, 12.5]), st.integers(1, 5), st.integers(0, 10**6))
def test_a_slower_series_is_part_of_one_that_is_a_multiple(rate: float, times: int, first: int) -> None:
    for pulse in range(first, first + 50):
        assert not is_in_series(pulse, rate, FPS) or is_in_series(pulse, rate * times, FPS)


units_of_a_frame = st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=3)


@given(st.lists(units_of_a_frame, min_size=1, max_size=4), st.integers(0, 2**40), st.integers(1, 10**5))
def test_frames_come_out_of_fragments_as_they_went_in(
    content: list[list[bytes]], first: int, lasts: int
) -> None:
    data = b"".join(
        fragment(
            [
                FragmentSample(
                    b"".join(len(unit).to_bytes(4, "big") + unit for unit in units), key=False, lasts=lasts
                )
            ],
            first + place,
            FPS,
        )
        for place, units in enumerate(content)
    )
    found = list(demux_mp4(data, FPS))
    assert [frame.pulse for frame in found] == list(range(first, first + len(content)))
    assert {frame.lasts for frame in found} == {lasts}
    assert [frame.data for frame in found] == [
        b"".join(b"\x00\x00\x00\x01" + unit for unit in units) for units in content
    ]
    assert first_pulse(data, FPS) == first


@given(st.binary(max_size=200))
def test_any_bytes_are_no_frames_or_frames_but_no_error(data: bytes) -> None:
    list(demux_mp4(data, FPS))
    list(demux_mp4(fragments(0, 1)[:-1] + data, FPS))


def test_every_picture_is_its_own_frames() -> None:
    drawn = StreamRenderer(CANVAS).draw(
        RenderRequest(fragments=fragments(0, 2 * GOP), plain=[FPS], still="plain")
    )
    assert [picture.pulse for picture in drawn.plain] == list(range(2 * GOP))
    for picture in drawn.plain:
        assert far(picture.data, shown(0)[picture.pulse]) < 15
        assert far(picture.data, shown(0)[picture.pulse + 1]) > 30
    assert drawn.still == drawn.plain[-1]
    assert drawn.newest == 2 * GOP - 1


def test_what_nobody_wants_is_not_made_and_a_still_is_of_the_frame_before() -> None:
    studio = StreamRenderer(CANVAS)
    assert studio.draw(RenderRequest(still="boxed")) == RenderResult(newest=-1)
    assert studio.draw(RenderRequest(fragments=fragments(0, GOP))) == RenderResult(newest=GOP - 1)
    still = studio.draw(RenderRequest(still="plain")).still
    assert still is not None
    assert still.pulse == GOP - 1


def test_frames_before_a_key_frame_are_left_out() -> None:
    drawn = StreamRenderer(CANVAS).draw(RenderRequest(fragments=fragments(2, 2 * GOP), plain=[FPS]))
    assert [picture.pulse for picture in drawn.plain] == list(range(GOP, 2 * GOP + 2))


@settings(deadline=None, max_examples=25)
@given(st.binary(max_size=60), st.integers(0, GOP - 1))
def test_a_damaged_frame_spoils_nothing_after_its_gop(damage: bytes, place: int) -> None:
    studio = StreamRenderer(CANVAS)
    broken = fragment([FragmentSample(len(damage).to_bytes(4, "big") + damage, key=False)], place, FPS)
    studio.draw(RenderRequest(fragments=fragments(0, place) + broken + fragments(place + 1, GOP - place - 1)))
    drawn = studio.draw(RenderRequest(fragments=fragments(GOP, GOP), plain=[FPS]))
    assert [picture.pulse for picture in drawn.plain] == list(range(GOP, 2 * GOP))
    assert all(far(picture.data, shown(0)[picture.pulse]) < 15 for picture in drawn.plain)


@settings(deadline=None, max_examples=10)
@given(st.integers(2**62, 2**64 - 1))
def test_a_time_that_never_comes_is_damage(ticks: int) -> None:
    whole = fragments(0, GOP)
    start = whole.index(b"tfdt") + len(b"tfdt") + 4
    studio = StreamRenderer(CANVAS)
    broken = whole[:start] + ticks.to_bytes(8, "big") + whole[start + 8 :]
    assert studio.draw(RenderRequest(fragments=broken, film=True, still="plain")) == RenderResult(newest=-1)
    assert len(studio.draw(RenderRequest(fragments=fragments(GOP, GOP), film=True)).film) == GOP


def test_the_film_has_the_cameras_gops_and_begins_anew_where_time_goes_back() -> None:
    studio = StreamRenderer(CANVAS)
    keys = [
        [unit.key for unit in studio.draw(RenderRequest(fragments=fragments(first, GOP), film=True)).film]
        for first in (0, GOP, GOP)
    ]
    assert keys == [[True] + [False] * (GOP - 1)] * 3


def test_the_chosen_persons_box_lies_over_the_others() -> None:
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    draw_boxes(image, [(7, 10, 20, 40, 40), (3, 10, 20, 40, 40), (5, 30, 5, 60, 45)], 3)
    assert tuple(image[30, 10]) == CHOSEN_COLOR
    assert tuple(image[30, 59]) == OTHER_COLOR
    draw_boxes(
        image,
        [(1, -500.0, -500.0, 9000.0, 9000.0), (2, 3.0, 3.0, 3.0, 3.0), (3, -1e300, 4.0, 3e9, 9.0)],
        None,
    )


def test_the_process_answers_until_its_input_ends() -> None:
    asked = (
        encode_message(CANVAS)
        + encode_message(RenderRequest(fragments=fragments(0, GOP), film=True))
        + encode_message(RenderRequest())
    )
    for cut in (0, 1, 7):
        answers = io.BytesIO()
        serve(io.BytesIO(asked[: len(asked) - cut]), answers)
        assert answers.getvalue().startswith(READY)
        data, found = answers.getvalue()[len(READY) :], []
        while data:
            size = int.from_bytes(data[:4], "big")
            found.append(msgspec.msgpack.decode(data[4 : 4 + size], type=RenderResult))
            data = data[4 + size :]
        assert len(found) == (1 if cut else 2)
        assert len(found[0].film) == GOP
    serve(io.BytesIO(b""), io.BytesIO())


def test_the_process_itself_ends_when_nobody_is_left_to_ask() -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "server.service.rendering.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    out, _ = process.communicate(
        encode_message(CANVAS) + encode_message(RenderRequest(fragments=fragments(0, 1))), timeout=PATIENCE
    )
    assert msgspec.msgpack.decode(out[len(READY) + 4 :], type=RenderResult).newest == 0
    assert process.returncode == 0


async def test_a_worker_that_is_ended_while_it_answers_leaves_nothing_open() -> None:
    before = set(Path("/proc/self/fd").iterdir())
    endless = "import os\nwhile True: os.write(1, bytes(65536))"
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", endless, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    async with asyncio.timeout(PATIENCE):
        while not getattr(process.stdout, "_paused"):  # noqa: ASYNC110, B009 — more has come than is kept
            await asyncio.sleep(0)
        await RenderWorker(process).end()
        while not before.issuperset(Path("/proc/self/fd").iterdir()):  # noqa: ASYNC110
            await asyncio.sleep(0)
