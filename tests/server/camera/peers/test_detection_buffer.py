"""The buffer waits for peers that are in time, and only once for a late one."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from server.camera.peers.detection_buffer import PeerDetectionBuffer
from server.messaging.messages import FrameDetections

PATIENCE, MOST = 0.2, 50


def detections(pulse: int, camera: str = "c1", boot: int = 1, *, ended: bool = False) -> FrameDetections:
    return FrameDetections(camera=camera, boot=boot, size=(640, 480), pulse=pulse, boxes=b"", ended=ended)


def buffer(*peers: str, has_common_ground: bool = True) -> PeerDetectionBuffer:
    return PeerDetectionBuffer(peers or ("c1",), MOST, lambda _: has_common_ground)


def messages_at(peer_buffer: PeerDetectionBuffer, pulse: int) -> list[tuple[str, int]]:
    return [(message.camera, message.pulse) for message in peer_buffer.detections_at(pulse).messages]


def test_detections_are_returned_in_configuration_order() -> None:
    peer_buffer = buffer("c1", "c2")
    peer_buffer.put(detections(7, "c2"), 0.0)
    peer_buffer.put(detections(7, "c1"), 0.0)
    peer_buffer.expect(7, 1.0)
    assert not peer_buffer.must_wait(7)
    assert messages_at(peer_buffer, 7) == [("c1", 7), ("c2", 7)]
    assert not peer_buffer.detections_at(7).is_incomplete


def test_a_camera_that_never_connected_is_waited_for_once() -> None:
    peer_buffer = buffer()
    peer_buffer.expect(0, 0.0)
    assert peer_buffer.must_wait(0)
    assert peer_buffer.give_up(0) == ["c1"]
    assert peer_buffer.detections_at(0).is_incomplete
    for pulse in range(1, 50):
        peer_buffer.expect(pulse, pulse / 25)
        assert not peer_buffer.must_wait(pulse)
        assert peer_buffer.detections_at(pulse).is_incomplete, "but reported as incomplete"


def test_a_late_camera_is_waited_for_again_once_its_messages_arrive_in_time() -> None:
    peer_buffer = buffer()
    peer_buffer.put(detections(0), 0.0)
    peer_buffer.expect(1, PATIENCE)
    peer_buffer.give_up(1)
    peer_buffer.put(detections(1), PATIENCE + 0.01)
    peer_buffer.expect(2, 0.3 + PATIENCE)
    assert not peer_buffer.must_wait(2), "still later than the timeout"
    peer_buffer.put(detections(2), 0.3 + PATIENCE / 2)
    peer_buffer.expect(3, 0.34 + PATIENCE)
    assert peer_buffer.must_wait(3)
    peer_buffer.put(detections(3), 0.36)
    assert not peer_buffer.must_wait(3)
    assert messages_at(peer_buffer, 3) == [("c1", 3)]


def test_a_lost_message_is_not_waited_for_after_a_later_one() -> None:
    peer_buffer = buffer()
    peer_buffer.put(detections(4), 0.0)
    peer_buffer.expect(3, 0.0)
    assert not peer_buffer.must_wait(3)
    assert peer_buffer.detections_at(3).is_incomplete
    peer_buffer.expect(4, 0.0)
    assert messages_at(peer_buffer, 4) == [("c1", 4)]


def test_an_ended_recording_is_not_waited_for() -> None:
    peer_buffer = buffer()
    peer_buffer.put(detections(4), 0.0)
    peer_buffer.put(detections(5, ended=True), 0.0)
    peer_buffer.expect(4, 0.0)
    assert messages_at(peer_buffer, 4) == [("c1", 4)]
    for pulse in (5, 6):
        peer_buffer.expect(pulse, 0.0)
        assert not peer_buffer.must_wait(pulse)
        assert peer_buffer.detections_at(pulse).messages == ()
        assert not peer_buffer.detections_at(pulse).is_incomplete


def test_a_restarted_camera_is_waited_for() -> None:
    peer_buffer = buffer()
    peer_buffer.put(detections(4), 0.0)
    peer_buffer.put(detections(5, ended=True), 0.0)
    peer_buffer.put(detections(9, boot=2), 0.0)
    peer_buffer.expect(10, 0.0)
    assert peer_buffer.must_wait(10)


def test_a_camera_without_common_ground_is_not_waited_for() -> None:
    peer_buffer = buffer(has_common_ground=False)
    assert not peer_buffer.put(detections(0), 0.0)
    for pulse in range(3):
        peer_buffer.expect(pulse, 0.0)
        assert not peer_buffer.must_wait(pulse)
        assert peer_buffer.detections_at(pulse).messages == ()
        assert not peer_buffer.detections_at(pulse).is_incomplete


def test_buffered_messages_are_bounded() -> None:
    peer_buffer = buffer()
    for pulse in range(10 * MOST):
        peer_buffer.put(detections(pulse), 0.0)
    peer_buffer.expect(MOST - 1, 0.0)
    assert messages_at(peer_buffer, MOST - 1) == [("c1", MOST - 1)]
    peer_buffer.expect(MOST, 0.0)
    assert not peer_buffer.must_wait(MOST)
    assert peer_buffer.detections_at(MOST).is_incomplete


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.booleans(), st.integers(0, 3), st.floats(0, 0.5)), max_size=40))
def test_between_two_timeouts_a_message_arrives_in_time(steps: list[tuple[bool, int, float]]) -> None:
    """Each step is a message some pulses later, or an expectation of the next pulse."""
    peer_buffer = buffer()
    peer_buffer.put(detections(0), 0.0)
    now, sent, expected = 0.0, 0, -1
    trusted = True
    times: dict[int, float] = {}
    for is_message, skipped, seconds in steps:
        now += seconds
        if is_message:
            sent += 1 + skipped
            peer_buffer.put(detections(sent), now)
            if sent > expected or now <= times.get(sent, -1.0) + PATIENCE:
                trusted = True
        else:
            expected += 1
            times[expected] = now
            peer_buffer.expect(expected, now + PATIENCE)
            waits = peer_buffer.must_wait(expected)
            assert waits == (trusted and sent < expected)
            if waits:
                now += PATIENCE
                peer_buffer.give_up(expected)
                trusted = False
