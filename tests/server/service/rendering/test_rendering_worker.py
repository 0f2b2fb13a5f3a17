"""The render worker: frames are drawn with their own boxes, and damage is confined to its GOP."""

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

from fakes.service.rendering import RENDER_SETTINGS, decoded_frames, fragments
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH
from fakes.timeouts import PATIENCE
from server.media.containers.fmp4 import FragmentSample, fragment
from server.media.rendering_messages import RenderRequest, RenderResult, is_at_rate
from server.service.rendering.decided_boxes import first_pulse
from server.service.rendering.worker.__main__ import serve
from server.service.rendering.worker.box_overlay import CHOSEN_COLOR, OTHER_COLOR, Image, draw_boxes
from server.service.rendering.worker.demuxers import demux_mp4
from server.service.rendering.worker.stream_renderer import StreamRenderer
from server.system.worker.process import WorkerProcess
from server.system.worker.protocol import READY, encode_message

rates = st.floats(0.1, 60)


def difference(jpeg: bytes, image: Image) -> float:
    picture = np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))
    return float(np.abs(picture.astype(np.int16) - image).mean())


@given(rates, st.integers(0, 10**6), st.sampled_from([10.0, 12.5, 25.0, 30.0]))
def test_a_rate_selects_that_many_pictures_per_second(rate: float, first: int, fps: float) -> None:
    seconds = 40
    count = sum(is_at_rate(pulse, rate, fps) for pulse in range(first, first + round(seconds * fps)))
    assert abs(count - seconds * min(rate, fps)) <= 1.01


@given(st.sampled_from([1.0, 2.5, 5.0, 12.5]), st.integers(1, 5), st.integers(0, 10**6))
def test_the_pictures_of_a_rate_are_among_those_of_its_multiples(rate: float, times: int, first: int) -> None:
    for pulse in range(first, first + 50):
        assert not is_at_rate(pulse, rate, FPS) or is_at_rate(pulse, rate * times, FPS)


units_of_a_frame = st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=3)


@given(st.lists(units_of_a_frame, min_size=1, max_size=4), st.integers(0, 2**40), st.integers(1, 10**5))
def test_demuxing_returns_the_muxed_frames(content: list[list[bytes]], first: int, duration: int) -> None:
    data = b"".join(
        fragment(
            [
                FragmentSample(
                    b"".join(len(unit).to_bytes(4, "big") + unit for unit in units),
                    key=False,
                    duration=duration,
                )
            ],
            first + place,
            FPS,
        )
        for place, units in enumerate(content)
    )
    demuxed = list(demux_mp4(data, FPS))
    assert [frame.pulse for frame in demuxed] == list(range(first, first + len(content)))
    assert {frame.duration for frame in demuxed} == {duration}
    assert [frame.data for frame in demuxed] == [
        b"".join(b"\x00\x00\x00\x01" + unit for unit in units) for units in content
    ]
    assert first_pulse(data, FPS) == first


@given(st.binary(max_size=200))
def test_demuxing_arbitrary_bytes_raises_no_error(data: bytes) -> None:
    list(demux_mp4(data, FPS))
    list(demux_mp4(fragments(0, 1)[:-1] + data, FPS))


def test_each_picture_shows_its_own_frame() -> None:
    result = StreamRenderer(RENDER_SETTINGS).render(
        RenderRequest(fragments=fragments(0, 2 * GOP), plain=[FPS], still="plain")
    )
    assert [picture.pulse for picture in result.plain] == list(range(2 * GOP))
    for picture in result.plain:
        assert difference(picture.data, decoded_frames(0)[picture.pulse]) < 15
        assert difference(picture.data, decoded_frames(0)[picture.pulse + 1]) > 30
    assert result.still == result.plain[-1]
    assert result.newest == 2 * GOP - 1


def test_only_requested_pictures_are_made_and_a_still_shows_the_last_frame() -> None:
    renderer = StreamRenderer(RENDER_SETTINGS)
    assert renderer.render(RenderRequest(still="boxed")) == RenderResult(newest=-1)
    assert renderer.render(RenderRequest(fragments=fragments(0, GOP))) == RenderResult(newest=GOP - 1)
    still = renderer.render(RenderRequest(still="plain")).still
    assert still is not None
    assert still.pulse == GOP - 1


def test_frames_before_the_first_keyframe_are_left_out() -> None:
    result = StreamRenderer(RENDER_SETTINGS).render(
        RenderRequest(fragments=fragments(2, 2 * GOP), plain=[FPS])
    )
    assert [picture.pulse for picture in result.plain] == list(range(GOP, 2 * GOP + 2))


@settings(deadline=None, max_examples=25)
@given(st.binary(max_size=60), st.integers(0, GOP - 1))
def test_a_damaged_frame_affects_nothing_after_its_gop(damage: bytes, place: int) -> None:
    renderer = StreamRenderer(RENDER_SETTINGS)
    broken = fragment([FragmentSample(len(damage).to_bytes(4, "big") + damage, key=False)], place, FPS)
    renderer.render(
        RenderRequest(fragments=fragments(0, place) + broken + fragments(place + 1, GOP - place - 1))
    )
    result = renderer.render(RenderRequest(fragments=fragments(GOP, GOP), plain=[FPS]))
    assert [picture.pulse for picture in result.plain] == list(range(GOP, 2 * GOP))
    assert all(difference(picture.data, decoded_frames(0)[picture.pulse]) < 15 for picture in result.plain)


@settings(deadline=None, max_examples=10)
@given(st.integers(2**62, 2**64 - 1))
def test_a_fragment_with_an_impossible_time_is_skipped(ticks: int) -> None:
    whole = fragments(0, GOP)
    start = whole.index(b"tfdt") + len(b"tfdt") + 4
    renderer = StreamRenderer(RENDER_SETTINGS)
    broken = whole[:start] + ticks.to_bytes(8, "big") + whole[start + 8 :]
    assert renderer.render(RenderRequest(fragments=broken, video="boxed", still="plain")) == RenderResult(
        newest=-1
    )
    assert len(renderer.render(RenderRequest(fragments=fragments(GOP, GOP), video="boxed")).video) == GOP


def test_the_video_has_the_gops_of_the_camera_and_a_keyframe_where_time_goes_back() -> None:
    renderer = StreamRenderer(RENDER_SETTINGS)
    keys = [
        [
            frame.key
            for frame in renderer.render(RenderRequest(fragments=fragments(first, GOP), video="boxed")).video
        ]
        for first in (0, GOP, GOP)
    ]
    assert keys == [[True] + [False] * (GOP - 1)] * 3


def test_the_box_of_the_chosen_person_is_drawn_over_the_others() -> None:
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    draw_boxes(image, [(7, 10, 20, 40, 40), (3, 10, 20, 40, 40), (5, 30, 5, 60, 45)], 3)
    assert tuple(image[30, 10]) == CHOSEN_COLOR
    assert tuple(image[30, 59]) == OTHER_COLOR
    draw_boxes(
        image,
        [(1, -500.0, -500.0, 9000.0, 9000.0), (2, 3.0, 3.0, 3.0, 3.0), (3, -1e300, 4.0, 3e9, 9.0)],
        None,
    )


def test_the_worker_answers_until_its_input_ends() -> None:
    requests = (
        encode_message(RENDER_SETTINGS)
        + encode_message(RenderRequest(fragments=fragments(0, GOP), video="boxed"))
        + encode_message(RenderRequest())
    )
    for cut in (0, 1, 7):
        answers = io.BytesIO()
        serve(io.BytesIO(requests[: len(requests) - cut]), answers)
        assert answers.getvalue().startswith(READY)
        data, results = answers.getvalue()[len(READY) :], []
        while data:
            size = int.from_bytes(data[:4], "big")
            results.append(msgspec.msgpack.decode(data[4 : 4 + size], type=RenderResult))
            data = data[4 + size :]
        assert len(results) == (1 if cut else 2)
        assert len(results[0].video) == GOP
    serve(io.BytesIO(b""), io.BytesIO())


def test_the_worker_process_ends_with_its_input() -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "server.service.rendering.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    out, _ = process.communicate(
        encode_message(RENDER_SETTINGS) + encode_message(RenderRequest(fragments=fragments(0, 1))),
        timeout=PATIENCE,
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
        while not getattr(process.stdout, "_paused"):  # noqa: ASYNC110, B009 — the buffer is full
            await asyncio.sleep(0)
        await WorkerProcess(process, RenderResult, PATIENCE).kill()
        while not before.issuperset(Path("/proc/self/fd").iterdir()):  # noqa: ASYNC110
            await asyncio.sleep(0)


async def test_a_worker_whose_killing_is_cancelled_leaves_nothing_open() -> None:
    worker = await WorkerProcess.start(
        "server.service.rendering.worker", RENDER_SETTINGS, RenderResult, PATIENCE
    )
    killing = asyncio.create_task(worker.kill())
    await asyncio.sleep(0)
    killing.cancel()
    await asyncio.gather(killing, return_exceptions=True)
    assert killing.cancelled()
    transport = worker._process._transport  # type: ignore[attr-defined]
    assert transport.is_closing(), "it would otherwise be open when the event loop ends"
    async with asyncio.timeout(PATIENCE):
        await worker._process.wait()
