"""The service's side of rendering: pacing, videos that survive their worker, boxes by pulse."""

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

from fakes.service.rendering import RENDER_SETTINGS, decoded_frames, fragments
from fakes.service.scripted_cameras import FPS, GOP, encoded
from server.media.audio.audio_format import AudioFormat
from server.media.rendering_messages import EncodedFrame, JpegPicture, RenderResult
from server.messaging.messages import AudioHeader, GopChoices
from server.service.rendering.decided_boxes import NO_OVERLAY, DecidedBoxes
from server.service.rendering.mjpeg_streams import MjpegStreams, MjpegVariant, PicturePacer
from server.service.rendering.overlay_video import OverlayVideoPublisher
from server.service.rendering.rendered_stream import StillRequests
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Subscriber

EVERY = MjpegVariant(FPS, boxed=False)


@given(st.lists(st.tuples(st.floats(0, 2), st.integers(1, 40)), max_size=30), st.floats(0.2, 2))
def test_no_picture_is_shown_before_it_arrives_or_held_back_too_long(
    steps: list[tuple[float, int]], max_delay_s: float
) -> None:
    pacer, now, pulse, last = PicturePacer(FPS, max_delay_s), 0.0, 0, 0.0
    for wait, step in steps:
        now, pulse = now + wait, pulse + step
        due = pacer.schedule(pulse, now)
        assert now - 1e-6 <= due <= now + max_delay_s + 1e-6
        if due > last and wait == 0:
            assert due - last <= step / FPS + 1e-6
        last = due


@given(st.integers(0, 10**6), st.lists(st.floats(0, 0.3), min_size=5, max_size=5))
def test_gops_that_arrive_unevenly_are_shown_evenly_after_the_latest(first: int, late: list[float]) -> None:
    pacer = PicturePacer(FPS, 4 * GOP / FPS)
    worst = late.index(max(late))
    shown = [
        (pulse, pacer.schedule(pulse, number * GOP / FPS + delay))
        for number, delay in enumerate(late)
        for pulse in range(first + number * GOP, first + (number + 1) * GOP)
    ]
    after = shown[worst * GOP :]
    for (pulse, at), (following, then) in pairwise(after):
        assert then - at == pytest.approx((following - pulse) / FPS, abs=1e-6)


def frames(first: int, count: int) -> list[EncodedFrame]:
    return [EncodedFrame(unit.pulse, unit.key, unit.data) for unit in encoded(0)[first : first + count]]


def queued_data(subscriber: Subscriber) -> bytes:
    return b"".join(chunk.data for chunk in subscriber._queue)


def test_a_video_has_no_gap_and_never_goes_back_when_its_worker_is_replaced() -> None:
    video = OverlayVideoPublisher(RENDER_SETTINGS, 8)
    assert video.head is None
    viewer = video.broadcaster.subscribe()
    video.put(frames(0, 2 * GOP))
    video.begin_process()
    video.put(frames(GOP, GOP))  # shown already
    video.put(frames(2 * GOP + 1, GOP - 1))  # refers to frames of the other worker
    video.put(frames(3 * GOP, GOP))
    assert video.head is not None
    data = video.head + queued_data(viewer)
    with av.open(io.BytesIO(data), "r") as stream:
        pictures = {round(float(frame.time or 0) * FPS): frame for frame in stream.decode(video=0)}
    assert list(pictures) == list(range(4 * GOP))
    for pulse, picture in pictures.items():
        repeated = 2 * GOP <= pulse < 3 * GOP
        same = decoded_frames(0)[2 * GOP - 1 if repeated else pulse]
        np.testing.assert_array_equal(picture.to_ndarray(format="bgr24"), same)


def test_a_video_is_silent_where_its_pictures_are_muted() -> None:
    form = AudioFormat(48_000, 2)
    audio_buffer = AudioBuffer(form, FPS, 60.0)
    audio_buffer.put(AudioHeader(first=0, sizes=[9] * 30), b"not quiet" * 30)
    video = OverlayVideoPublisher(RENDER_SETTINGS, 8, audio_buffer)
    viewer = video.broadcaster.subscribe()
    for gop in range(3):
        video.put(frames(gop * GOP, GOP), is_muted=gop == 1)
    chunks = [chunk for chunk in viewer._queue if isinstance(chunk, MediaChunk)]
    audible = [set(chunk.audio.frames) for chunk in chunks if chunk.audio is not None]
    assert audible == [{b"not quiet"}, {form.silence}, {b"not quiet"}]


@pytest.mark.parametrize("is_muted", [False, True])
def test_the_gaps_of_a_video_are_muted_on_request(*, is_muted: bool) -> None:
    form = AudioFormat(48_000, 2)
    audio_buffer = AudioBuffer(form, FPS, 60.0)
    audio_buffer.put(AudioHeader(first=0, sizes=[9] * 30), b"not quiet" * 30)
    video = OverlayVideoPublisher(RENDER_SETTINGS, 8, audio_buffer, mute_gaps=is_muted)
    viewer = video.broadcaster.subscribe()
    video.put(frames(0, GOP))
    video.put(frames(2 * GOP, GOP))
    chunks = [chunk for chunk in viewer._queue if isinstance(chunk, MediaChunk)]
    audible = [set(chunk.audio.frames) for chunk in chunks if chunk.audio is not None]
    assert audible == [{b"not quiet"}, {form.silence if is_muted else b"not quiet"}, {b"not quiet"}]


def test_a_new_viewer_of_a_video_begins_with_the_newest_gop() -> None:
    video = OverlayVideoPublisher(RENDER_SETTINGS, 8)
    video.put(frames(0, 2 * GOP))
    assert queued_data(video.broadcaster.subscribe()) == fragments(GOP, GOP)


def test_only_the_newest_picture_waits_for_a_viewer() -> None:
    mjpeg = MjpegStreams(RENDER_SETTINGS, live=True)
    viewer = mjpeg.subscribe(EVERY)
    slow = mjpeg.subscribe(MjpegVariant(1.0, boxed=False))
    for pulse in range(30):
        mjpeg.put(RenderResult(newest=pulse, plain=[JpegPicture(pulse, b"picture %d." % pulse)]), now=0.0)
        assert mjpeg.publish_due(0.0) is None
    assert [b"picture 29." in chunk.data for chunk in viewer._queue] == [True]
    assert [b"picture 25." in chunk.data for chunk in slow._queue] == [True]
    assert mjpeg.rates(boxed=False) == [1.0, FPS]
    mjpeg.unsubscribe(EVERY, viewer)
    assert mjpeg.rates(boxed=False) == [1.0]
    assert mjpeg.rates(boxed=True) == []


def test_pictures_that_arrive_together_are_published_one_by_one_when_due() -> None:
    mjpeg = MjpegStreams(RENDER_SETTINGS, live=False)
    mjpeg.subscribe(EVERY)
    mjpeg.put(RenderResult(newest=4, plain=[JpegPicture(pulse, b"") for pulse in range(5)]), now=10.0)
    times = [10.0]
    while (next_due := mjpeg.publish_due(times[-1])) is not None:
        times.append(next_due)
    assert times == pytest.approx([10.0 + place / FPS for place in range(5)])


def choices(first: int, camera: str = "c0", number: int = 1) -> GopChoices:
    boxes = [[(number, float(pulse), 0.0, 1.0, 1.0)] for pulse in range(first, first + GOP)]
    return GopChoices(first=first, frames=GOP, choices={number: camera}, boxes={camera: boxes}, cuts=[])


def decided(resolve: Callable[[int], int] = lambda number: number, gops: int = 3) -> DecidedBoxes:
    return DecidedBoxes(resolve, FPS, gops)


async def test_a_request_for_a_newer_picture_is_not_answered_with_an_older_one() -> None:
    stills = StillRequests()
    early, late = (asyncio.create_task(stills.get("plain", pulse)) for pulse in (100, 125))
    await asyncio.sleep(0)
    assert stills.answerable(101) == ["plain"]
    stills.answer("plain", JpegPicture(101, b""))
    assert await early == JpegPicture(101, b"")
    await stills.changed.wait()
    await asyncio.sleep(0)
    assert stills.answerable(124) == []
    stills.answer("plain", JpegPicture(125, b""))
    assert await late == JpegPicture(125, b"")


def test_boxes_are_found_by_the_pulse_of_the_frames() -> None:
    decided_boxes = decided()
    assert decided_boxes.newest is None
    for first in range(0, 5 * GOP, GOP):
        decided_boxes.put(choices(first))
    assert decided_boxes.newest == 5 * GOP - 1
    overlay = decided_boxes.overlay_of_person(1, fragments(3 * GOP, GOP))
    assert overlay.first == 3 * GOP
    assert overlay.chosen == 1
    assert [boxes[0][1] for boxes in overlay.boxes] == list(range(3 * GOP, 4 * GOP))
    assert decided_boxes.overlay_of_person(1, fragments(0, GOP)) is NO_OVERLAY, "older than any queued frame"
    assert decided_boxes.overlay_of_person(2, fragments(3 * GOP, GOP)) is NO_OVERLAY
    assert decided_boxes.overlay_of_camera("c0", fragments(3 * GOP + 2, 1)).boxes == overlay.boxes


def test_a_merged_number_has_the_boxes_of_the_person_it_was_merged_into() -> None:
    decided_boxes = decided({5: 1}.get)  # type: ignore[arg-type]
    decided_boxes.put(choices(0, number=5))
    decided_boxes.put(choices(GOP, number=1))
    assert decided_boxes.overlay_of_person(5, fragments(0, GOP)).chosen == 5
    assert decided_boxes.overlay_of_person(5, fragments(GOP, GOP)).chosen == 1
