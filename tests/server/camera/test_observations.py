"""Detections travel to the joint tracker as they were found, where the camera was when it was calibrated."""

from __future__ import annotations

import msgspec
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from server.camera.observations import ObservationCollector
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks
from server.messaging.observations import (
    FRAME_DETECTIONS_MAX,
    FrameObservations,
    pack_histograms,
    unpack_observations,
)
from server.service.ingest.validation import is_plausible
from tracking import Detections
from tracking.detectors.background.motion import STILL, Motion

SIZE = (640, 360)


def some_detections(count: int, bins: int, seed: int = 0) -> Detections:
    random = np.random.default_rng(seed)
    corner, size = random.uniform(0.0, 300.0, (count, 2)), random.uniform(5.0, 50.0, (count, 2))
    histograms = random.dirichlet(np.ones(bins), count) if bins else np.zeros((count, 0))
    return Detections(np.hstack([corner, corner + size]), random.uniform(0.0, 1.0, count), histograms)


@given(st.integers(0, 6), st.sampled_from([0, 1, 96]), st.integers(0, 99))
def test_detections_arrive_as_they_were_found(count: int, bins: int, seed: int) -> None:
    found, collector = some_detections(count, bins, seed), ObservationCollector(Letterbox(SIZE, SIZE))
    collector.add(7, found, STILL)
    (sent,) = collector.take()
    received = msgspec.json.decode(msgspec.json.encode(sent), type=FrameObservations)
    assert received.pulse == 7
    assert collector.take() == []
    arrived = unpack_observations(received)
    np.testing.assert_allclose(arrived.boxes, found.boxes, atol=0.051)
    np.testing.assert_allclose(arrived.scores, found.scores, atol=0.00051)
    if count:
        np.testing.assert_allclose(arrived.histograms, found.histograms, atol=0.001)


def test_boxes_are_where_they_were_before_the_camera_was_knocked() -> None:
    found, motion = some_detections(3, 0), Motion(x=10.0, y=-4.0)
    collector = ObservationCollector(Letterbox((1280, 720), SIZE))
    collector.add(0, found, motion)
    arrived = unpack_observations(collector.take()[0])
    np.testing.assert_allclose(arrived.boxes, 2.0 * (found.boxes - [10.0, -4.0, 10.0, -4.0]), atol=0.051)


def test_of_too_many_detections_the_most_confident_are_sent() -> None:
    found = some_detections(FRAME_DETECTIONS_MAX + 20, 4)
    collector = ObservationCollector(Letterbox(SIZE, SIZE))
    collector.add(0, found, STILL)
    arrived = unpack_observations(collector.take()[0])
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
    box, look = (1.0, 1.0, 5.0, 9.0, 0.5), pack_histograms(np.ones((1, 4)) / 4)
    good = FrameObservations(pulse=8, boxes=[box], histograms=look)
    assert is_plausible(message(good, FrameObservations(pulse=9, boxes=[])), 5)
    for bad in (
        FrameObservations(pulse=10, boxes=[box]),  # of the next epoch
        FrameObservations(pulse=8, boxes=[box]),  # twice
        FrameObservations(pulse=9, boxes=[box, box], histograms=look[:-2]),
        FrameObservations(pulse=9, boxes=[], histograms=look),
    ):
        assert not is_plausible(message(good, bad), 5)
