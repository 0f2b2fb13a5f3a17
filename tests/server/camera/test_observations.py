"""Detections travel to the joint tracker as they were found, where the camera was when it was calibrated."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.camera.observations import ObservationCollector, most_confident
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks
from server.messaging.observations import FrameObservations, unpack_observations
from server.messaging.packed_arrays import FRAME_DETECTIONS_MAX, pack_detections, pack_histograms
from server.messaging.picture_motion import picture_motion
from server.service.ingest.validation import is_plausible
from tracking import Detections
from tracking.detectors.background.motion import Motion

SIZE = (640, 360)
STRIDE = 5


def some_detections(count: int, bins: int, seed: int = 0) -> Detections:
    random = np.random.default_rng(seed)
    corner, size = random.uniform(0.0, 300.0, (count, 2)), random.uniform(5.0, 50.0, (count, 2))
    histograms = random.dirichlet(np.ones(bins), count) if bins else np.zeros((count, 0))
    return Detections(np.hstack([corner, corner + size]), random.uniform(0.0, 1.0, count), histograms)


@given(st.integers(0, 6), st.sampled_from([0, 1, 96]), st.integers(0, 99))
def test_detections_arrive_as_they_were_found(count: int, bins: int, seed: int) -> None:
    found, collector = some_detections(count, bins, seed), ObservationCollector(Letterbox(SIZE, SIZE), STRIDE)
    collector.add(7, found, None)
    assert collector.take(6) == [], "it is of the next epoch"
    (sent,) = collector.take(7)
    received = msgspec.msgpack.decode(msgspec.msgpack.encode(sent), type=FrameObservations)
    assert received.pulse == 7
    assert collector.take(7) == []
    arrived = unpack_observations(received)
    np.testing.assert_allclose(arrived.boxes, found.boxes, atol=0.051)
    np.testing.assert_allclose(arrived.scores, found.scores, atol=0.00051)
    if count:
        np.testing.assert_allclose(arrived.histograms, found.histograms, atol=0.001)


def test_skipped_frames_have_detections_between_those_around_them() -> None:
    """As in the camera's own tracker; not at an epoch's end, which does not wait, nor across a long gap."""
    collector = ObservationCollector(Letterbox(SIZE, SIZE), STRIDE)
    collector.skip(0)
    for pulse in (1, 4, 13):
        boxes = np.array([[10.0 + pulse, 20.0, 30.0 + pulse, 80.0]])
        collector.add(pulse, Detections(boxes, np.array([0.9]), np.zeros((1, 0))), None)
        for skipped in (pulse + 1, pulse + 2):
            collector.skip(skipped)
    sent = collector.take(STRIDE - 1)
    assert [frame.pulse for frame in sent] == [1, 2, 3, 4]
    assert [unpack_observations(frame).boxes[0, 0] for frame in sent] == pytest.approx([11, 12, 13, 14])
    assert [frame.pulse for frame in collector.take(14)] == [13]


def test_boxes_are_where_they_were_before_the_camera_was_knocked() -> None:
    found, motion = some_detections(3, 0), picture_motion(Motion(x=10.0, y=-4.0).homography(SIZE), SIZE)
    collector = ObservationCollector(Letterbox((1280, 720), SIZE), STRIDE)
    collector.add(0, found, motion)
    arrived = unpack_observations(collector.take(7)[0])
    np.testing.assert_allclose(arrived.boxes, 2.0 * (found.boxes - [10.0, -4.0, 10.0, -4.0]), atol=0.051)


def test_boxes_that_were_beyond_the_horizon_are_left_out() -> None:
    """Sent as they are they would make the whole message invalid."""
    found = Detections(
        np.array([[10.0, 20.0, 30.0, 60.0], [10.0, 220.0, 30.0, 300.0]]), np.array([0.5, 0.7]), np.eye(2)
    )
    before = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -0.005, 1.0]])
    collector = ObservationCollector(Letterbox(SIZE, SIZE), STRIDE)
    collector.add(0, found, picture_motion(np.linalg.inv(before), SIZE))
    (sent,) = collector.take(7)
    arrived = unpack_observations(sent)
    assert arrived.scores == pytest.approx([0.5], abs=1e-3)
    assert is_plausible(message(msgspec.structs.replace(sent, pulse=6)), 5)


def test_of_too_many_detections_the_most_confident_are_sent() -> None:
    found = some_detections(FRAME_DETECTIONS_MAX + 20, 4)
    collector = ObservationCollector(Letterbox(SIZE, SIZE), STRIDE)
    collector.add(0, most_confident(found), None)
    arrived = unpack_observations(collector.take(7)[0])
    assert len(arrived) == FRAME_DETECTIONS_MAX
    assert arrived.scores.min() >= np.sort(found.scores)[20] - 0.001


def message(*frames: FrameObservations) -> CameraTracks:
    return CameraTracks(
        camera="c0",
        boot=1,
        size=SIZE,
        epoch=1,
        first=5,
        last=9,
        final_to=9,
        ended=False,
        shed=[],
        tracks=[],
        solve=None,
        observations=list(frames),
    )


def test_observations_that_do_not_fit_are_refused() -> None:
    box = pack_detections(np.array([[1.0, 1.0, 5.0, 9.0]]), np.array([0.5]))
    good = FrameObservations(pulse=8, boxes=box, histograms=pack_histograms(np.ones((1, 4)) / 4))
    assert is_plausible(message(good, FrameObservations(pulse=9)), 5)
    assert not is_plausible(message(good, FrameObservations(pulse=10, boxes=box)), 5), "of the next epoch"
    assert not is_plausible(message(good, FrameObservations(pulse=8, boxes=box)), 5), "twice"


@pytest.mark.parametrize(
    "changes",
    [
        {"boxes": b"19 bytes are no row"},
        {"boxes": pack_detections(np.full((1, 4), np.nan), np.array([0.5]))},
        {"boxes": pack_detections(np.zeros((1, 4)), np.array([1.5]))},
        {"boxes": np.full(5, 2e6, "<f4").tobytes()},
        {"boxes": pack_detections(np.zeros((2, 4)), np.zeros(2)), "histograms": bytes(6)},
        {"boxes": b"", "histograms": bytes(8)},
    ],
)
def test_arrays_that_are_none_are_refused(changes: dict[str, bytes]) -> None:
    payload = msgspec.msgpack.encode({"pulse": 9, **changes})
    with pytest.raises(msgspec.ValidationError):
        msgspec.msgpack.decode(payload, type=FrameObservations)
