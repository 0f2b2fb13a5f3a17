"""What the service does with what is drawn: pace, films that survive their process, boxes by pulse."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Callable
from itertools import pairwise

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.service.rendering import CANVAS, fragments, shown
from fakes.service.scripted_cameras import FPS, GOP, encoded
from server.media.audio.audio_format import AudioFormat
from server.media.rendering_messages import EncodedFrame, JpegPicture, RenderResult
from server.messaging.messages import AudioHeader, GopChoices
from server.service.rendering.decided_boxes import NO_OVERLAY, DecidedBoxes
from server.service.rendering.mjpeg_streams import MjpegStreams, MjpegVariant, PicturePacer
from server.service.rendering.overlay_video import OverlayVideo
from server.service.rendering.rendered_stream import StillRequests
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Subscriber

EVERY = MjpegVariant(FPS, boxed=False)


@given(st.lists(st.tuples(st.floats(0, 2), st.integers(1, 40)), max_size=30), st.floats(0.2, 2))
def test_no_picture_is_shown_before_it_is_there_nor_kept_back_too_long(
    steps: list[tuple[float, int]], most: float
) -> None:
    pace, now, pulse, last = PicturePacer(FPS, most), 0.0, 0, 0.0
    for wait, step in steps:
        now, pulse = now + wait, pulse + step
        due = pace.due(pulse, now)
        assert now - 1e-6 <= due <= now + most + 1e-6
        if due > last and wait == 0:
            assert due - last <= step / FPS + 1e-6
        last = due


@given(st.integers(0, 10**6), st.lists(st.floats(0, 0.3), min_size=5, max_size=5))
def test_gops_that_come_unevenly_are_shown_evenly_once_the_latest_has_come(
    first: int, late: list[float]
) -> None:
    pace = PicturePacer(FPS, 4 * GOP / FPS)
    worst = late.index(max(late))
    shown = [
        (pulse, pace.due(pulse, number * GOP / FPS + delay))
        for number, delay in enumerate(late)
        for pulse in range(first + number * GOP, first + (number + 1) * GOP)
    ]
    after = shown[worst * GOP :]
    for (pulse, at), (following, then) in pairwise(after):
        assert then - at == pytest.approx((following - pulse) / FPS, abs=1e-6)


def units(first: int, count: int) -> list[EncodedFrame]:
    return [EncodedFrame(it.pulse, it.key, it.data) for it in encoded(0)[first : first + count]]


def pulses_sent(viewer: Subscriber) -> bytes:
    return b"".join(piece.data for piece in viewer._queue)


def test_a_film_that_goes_on_with_another_process_has_no_hole_and_never_goes_back() -> None:
    film = OverlayVideo(CANVAS, 8)
    assert film.head is None
    viewer = film.channel.subscribe()
    film.put(units(0, 2 * GOP))
    film.interrupted()
    film.put(units(GOP, GOP))  # seen already
    film.put(units(2 * GOP + 1, GOP - 1))  # builds on what the other process was given
    film.put(units(3 * GOP, GOP))
    assert film.head is not None
    data = film.head + pulses_sent(viewer)
    with av.open(io.BytesIO(data), "r") as stream:
        pictures = {round(float(it.time or 0) * FPS): it for it in stream.decode(video=0)}
    assert list(pictures) == list(range(4 * GOP))
    for pulse, picture in pictures.items():
        repeated = 2 * GOP <= pulse < 3 * GOP
        same = shown(0)[2 * GOP - 1 if repeated else pulse]
        np.testing.assert_array_equal(picture.to_ndarray(format="bgr24"), same)


def test_a_film_is_silent_where_its_pictures_are() -> None:
    form = AudioFormat(48_000, 2)
    frame_buffer = AudioBuffer(form, FPS, 60.0)
    frame_buffer.put(AudioHeader(first=0, sizes=[9] * 30), b"not quiet" * 30)
    film = OverlayVideo(CANVAS, 8, frame_buffer)
    viewer = film.channel.subscribe()
    for gop in range(3):
        film.put(units(gop * GOP, GOP), silent=gop == 1)
    pieces = [piece for piece in viewer._queue if isinstance(piece, MediaChunk)]
    told = [set(it.audio.frames) for it in pieces if it.audio is not None]
    assert told == [{b"not quiet"}, {form.silence}, {b"not quiet"}]


@pytest.mark.parametrize("silent", [False, True])
def test_the_holes_of_a_film_are_silent_where_nobody_knows_what_was_in_them(*, silent: bool) -> None:
    form = AudioFormat(48_000, 2)
    frame_buffer = AudioBuffer(form, FPS, 60.0)
    frame_buffer.put(AudioHeader(first=0, sizes=[9] * 30), b"not quiet" * 30)
    film = OverlayVideo(CANVAS, 8, frame_buffer, silent_holes=silent)
    viewer = film.channel.subscribe()
    film.put(units(0, GOP))
    film.put(units(2 * GOP, GOP))
    pieces = [piece for piece in viewer._queue if isinstance(piece, MediaChunk)]
    told = [set(it.audio.frames) for it in pieces if it.audio is not None]
    assert told == [{b"not quiet"}, {form.silence if silent else b"not quiet"}, {b"not quiet"}]


def test_whoever_comes_to_a_film_begins_with_its_newest_gop() -> None:
    film = OverlayVideo(CANVAS, 8)
    film.put(units(0, 2 * GOP))
    assert pulses_sent(film.channel.subscribe()) == fragments(GOP, GOP)


def test_a_viewer_of_pictures_has_the_newest_waiting_and_no_other() -> None:
    series = MjpegStreams(CANVAS, live=True)
    viewer = series.join(EVERY)
    slow = series.join(MjpegVariant(1.0, boxed=False))
    for pulse in range(30):
        series.put(RenderResult(newest=pulse, plain=[JpegPicture(pulse, b"picture %d." % pulse)]), now=0.0)
        assert series.show(0.0) is None
    assert [b"picture 29." in piece.data for piece in viewer._queue] == [True]
    assert [b"picture 25." in piece.data for piece in slow._queue] == [True]
    assert series.rates(boxed=False) == [1.0, FPS]
    series.leave(EVERY, viewer)
    assert series.rates(boxed=False) == [1.0]
    assert series.rates(boxed=True) == []


def test_pictures_that_come_together_are_passed_on_each_at_its_moment() -> None:
    series = MjpegStreams(CANVAS, live=False)
    series.join(EVERY)
    series.put(RenderResult(newest=4, plain=[JpegPicture(pulse, b"") for pulse in range(5)]), now=10.0)
    moments = [10.0]
    while (following := series.show(moments[-1])) is not None:
        moments.append(following)
    assert moments == pytest.approx([10.0 + place / FPS for place in range(5)])


def choices(first: int, camera: str = "c0", number: int = 1) -> GopChoices:
    boxes = [[(number, float(pulse), 0.0, 1.0, 1.0)] for pulse in range(first, first + GOP)]
    return GopChoices(first=first, frames=GOP, choices={number: camera}, boxes={camera: boxes}, cuts=[])


def decided(resolve: Callable[[int], int] = lambda number: number, gops: int = 3) -> DecidedBoxes:
    return DecidedBoxes(resolve, FPS, gops)


async def test_who_asks_for_a_newer_picture_than_others_is_given_no_older_one() -> None:
    stills = StillRequests()
    early, late = (asyncio.create_task(stills.get("plain", pulse)) for pulse in (100, 125))
    await asyncio.sleep(0)
    assert stills.possible(101) == ["plain"]
    stills.give("plain", JpegPicture(101, b""))
    assert await early == JpegPicture(101, b"")
    await stills.asked.wait()
    await asyncio.sleep(0)
    assert stills.possible(124) == []
    stills.give("plain", JpegPicture(125, b""))
    assert await late == JpegPicture(125, b"")


def test_boxes_are_found_by_the_pulse_of_the_frames() -> None:
    known = decided()
    assert known.newest is None
    for first in range(0, 5 * GOP, GOP):
        known.put(choices(first))
    assert known.newest == 5 * GOP - 1
    told = known.of_person(1, fragments(3 * GOP, GOP))
    assert told.first == 3 * GOP
    assert told.chosen == 1
    assert [boxes[0][1] for boxes in told.boxes] == list(range(3 * GOP, 4 * GOP))
    assert known.of_person(1, fragments(0, GOP)) is NO_OVERLAY, "too long ago to be waiting anywhere"
    assert known.of_person(2, fragments(3 * GOP, GOP)) is NO_OVERLAY
    assert known.of_camera("c0", fragments(3 * GOP + 2, 1)).boxes == told.boxes


def test_a_merged_number_has_the_boxes_of_whom_it_is() -> None:
    known = decided({5: 1}.get)  # type: ignore[arg-type]
    known.put(choices(0, number=5))
    known.put(choices(GOP, number=1))
    assert known.of_person(5, fragments(0, GOP)).chosen == 5
    assert known.of_person(5, fragments(GOP, GOP)).chosen == 1
