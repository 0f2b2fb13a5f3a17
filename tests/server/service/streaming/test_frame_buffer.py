"""A camera's newest frames, each packed into a fragment once; frames of other parameters are refused."""

from __future__ import annotations

import pytest

from fakes.service.scripted_cameras import FPS, encoded
from server.camera.encoder import AccessUnit
from server.media.stream_format import ParameterMismatchError, StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer


def put(frame_buffer: FrameBuffer, unit: AccessUnit) -> None:
    frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)


def test_the_oldest_frames_are_dropped() -> None:
    frame_buffer = FrameBuffer(FPS, 10, StreamFormat())
    for unit in encoded(0)[:25]:
        put(frame_buffer, unit)
    assert [pulse for pulse in range(30) if frame_buffer.has(pulse)] == list(range(15, 25))
    assert frame_buffer.newest == 24
    assert frame_buffer.get(3) is None


def test_the_pictures_of_a_gop_are_its_frames_in_order() -> None:
    frame_buffer = FrameBuffer(FPS, 20, StreamFormat())
    for unit in encoded(0)[:10]:
        put(frame_buffer, unit)
    frames = [frame_buffer.get(pulse) for pulse in range(5, 10)]
    assert frame_buffer.pictures(5, 5) == frames
    assert [frame.key for frame in frames if frame is not None] == [True, False, False, False, False]


def test_frames_with_other_parameters_are_refused_and_not_stored() -> None:
    stream_format = StreamFormat()
    first, second = FrameBuffer(FPS, 10, stream_format), FrameBuffer(FPS, 10, stream_format)
    put(first, encoded(0)[0])
    with pytest.raises(ParameterMismatchError, match="differ from the other cameras'"):
        put(second, encoded(1, crf=40)[0])
    assert not second.has(0)
    assert second.newest == -1
    put(second, encoded(1)[5])
    assert second.has(5), "with the right parameters the same camera is accepted"


@pytest.mark.parametrize("data", [b"", b"\x00\x00\x01", b"\x00\x00\x01\x67", b"no H.264 at all"])
def test_a_keyframe_without_parameter_sets_is_refused(data: bytes) -> None:
    frame_buffer = FrameBuffer(FPS, 10, StreamFormat())
    with pytest.raises(ParameterMismatchError, match="without parameter sets"):
        frame_buffer.put(0, 1, data, key=True)
    assert not frame_buffer.has(0)
