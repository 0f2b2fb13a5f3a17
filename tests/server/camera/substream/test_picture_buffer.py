"""Pictures of a moment are found among those of a substream, also long after it."""

from __future__ import annotations

import threading
import time

import numpy as np
from av.video.frame import VideoFrame
from hypothesis import given, settings
from hypothesis import strategies as st

from server.camera.sources.stream_clock import CaptureTime
from server.camera.substream.picture_buffer import BufferedPicture, PictureBuffer

BLACK = VideoFrame.from_ndarray(np.zeros((2, 2, 3), np.uint8), format="bgr24")
INTERVAL = 0.04


def picture(captured: float, *, delay: float = 0.0) -> BufferedPicture:
    return BufferedPicture(BLACK, 1.0, CaptureTime(captured + delay))


def test_a_picture_is_kept_for_whoever_has_looked_for_it() -> None:
    buffer, now = PictureBuffer(0.5, INTERVAL / 2), time.monotonic()
    request = buffer.request(CaptureTime(now - 3.0))
    buffer.put(picture(now - 3.0))
    for place in range(100):
        buffer.put(picture(now - 2.9 + place * 0.02))
    assert len(buffer._pictures) < 100
    found = buffer.wait(request, now)
    assert found is not None
    assert found.captured.arrival == now - 3.0


def test_a_later_picture_is_waited_for() -> None:
    buffer, now = PictureBuffer(5.0, INTERVAL / 2), time.monotonic()
    buffer.put(picture(now - INTERVAL))
    request = buffer.request(CaptureTime(now))
    threading.Timer(0.05, lambda: buffer.put(picture(now + 0.01))).start()
    found = buffer.wait(request, now + 30)
    assert found is not None
    assert found.captured.arrival == now + 0.01
    assert time.monotonic() < now + 20


def test_nothing_is_waited_for_where_no_picture_arrives() -> None:
    buffer, now = PictureBuffer(5.0, INTERVAL / 2), time.monotonic()
    assert buffer.wait(buffer.request(CaptureTime(now)), now + 30) is None
    buffer.put(picture(now))
    assert buffer.wait(buffer.request(CaptureTime(now + 1.0)), now) is None, "a second is another moment"
    assert time.monotonic() < now + 20


def test_pictures_are_bounded_by_their_memory_and_that_is_told() -> None:
    large = VideoFrame.from_ndarray(np.zeros((1080, 1920, 3), np.uint8), format="bgr24")
    size = BufferedPicture(large, 1.0, CaptureTime(0.0)).size_bytes
    assert size >= 1080 * 1920 * 3
    buffer, now = PictureBuffer(60.0, INTERVAL / 2, max_bytes=5 * size), time.monotonic()
    for place in range(5):
        buffer.put(BufferedPicture(large, 1.0, CaptureTime(now - 20 + place)))
    assert buffer.kept_s is None
    for place in range(5, 20):
        buffer.put(BufferedPicture(large, 1.0, CaptureTime(now - 20 + place)))
    assert len(buffer._pictures) == 5
    assert buffer.kept_s is not None
    assert 5 < buffer.kept_s < 60
    assert not buffer.is_too_many
    for _ in range(5):
        buffer.put(picture(now))  # small ones
    assert len(buffer._pictures) > 5, "the memory of those that went is free again"
    tiny = PictureBuffer(60.0, INTERVAL / 2, max_bytes=1)
    tiny.put(BufferedPicture(large, 1.0, CaptureTime(now)))
    assert tiny.wait(tiny.request(CaptureTime(now)), now) is not None


def test_pictures_are_bounded_by_their_number_and_that_is_told() -> None:
    buffer, now = PictureBuffer(60.0, INTERVAL / 2), time.monotonic()
    for place in range(601):
        buffer.put(picture(now - 10 + place / 100))
    assert buffer.kept_s is not None
    assert buffer.is_too_many


def test_a_request_that_was_waited_for_in_vain_stays_answered_and_is_forgotten() -> None:
    buffer, now = PictureBuffer(5.0, INTERVAL / 2), time.monotonic()
    buffer.put(picture(now - 3))
    request = buffer.request(CaptureTime(now))
    assert buffer.wait(request, now) is None
    assert list(buffer._open) == []
    buffer.put(picture(now))
    assert buffer.wait(request, now) is None, "its frame was handled without it"


@settings(max_examples=100, deadline=None)
@given(
    times=st.lists(st.floats(0.0, 10.0), min_size=1, max_size=40),
    moment=st.floats(0.0, 10.0),
    difference=st.floats(-0.9, 0.9),
    has_clock=st.booleans(),
)
def test_the_closest_picture_is_found(
    times: list[float], moment: float, difference: float, *, has_clock: bool
) -> None:
    """By the camera's clock where both streams have it, whatever their delays."""
    start = time.monotonic() - 10
    buffer = PictureBuffer(60.0, INTERVAL / 2)
    for captured in sorted(times):
        clock = captured if has_clock else None
        buffer.put(BufferedPicture(BLACK, 1.0, CaptureTime(start + captured + difference, clock)))
    asked = CaptureTime(start + moment, moment if has_clock else None)
    found = buffer.wait(buffer.request(asked), 0.0)
    aligned = times if has_clock else [captured + difference for captured in times]
    least = min(abs(captured - moment) for captured in aligned)
    if found is None:
        assert least > 0.25 - 1e-6
    else:
        assert abs(abs(found.captured.seconds_after(asked)) - least) < 1e-6


def test_streams_with_different_clocks_are_paired_by_arrival() -> None:
    one, other = CaptureTime(100.0, 5000.0), CaptureTime(100.1, 9000.0)
    assert abs(other.seconds_after(one) - 0.1) < 1e-9
