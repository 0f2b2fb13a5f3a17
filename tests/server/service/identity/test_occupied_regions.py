"""The regions that hide people: wider, longer and of more people than the published boxes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from fakes.service.fed_site import A, B
from fakes.service.scripted_cameras import (
    CAMERAS,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    TrackNumbers,
    camera_tracks,
    small_config,
    tracks,
)
from server.messaging.epochs import end_of_epoch
from server.messaging.messages import Box, RawDetections, TrackMessage
from server.messaging.packed_arrays import pack_boxes, pack_detections
from server.service.identity.occupied_regions import Regions
from server.service.ingest.epoch_aligner import Epoch, JointEpoch
from server.service.joint_tracking.epochs import without_tracks
from server.service.joint_tracking.joint_messages import JointTracks

HOLD, UNSEARCHED = 25, 12
"""Frames of a second, and of half a second."""


class Site:
    """A site whose viewers see people pixelated; tracks below 0 are not confirmed."""

    def __init__(self) -> None:
        self.service = FedService(small_config(access={"blur": "others"}))
        self.service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
        self.service.connect_cameras(*CAMERAS)
        self.service.on_decision.append(lambda choices: self.seen.append(choices.first))
        self.seen: list[int] = []
        self._epoch = 0

    def feed(self, boxes: dict[int, list[Box | None]] | None, **changes: Any) -> None:
        """Feed an epoch of camera A, a box per frame and track; None: it reports nothing. B sees nobody."""
        seen = [
            TrackMessage(id=track, boxes=pack_boxes(places), confidence=1.0)
            for track, places in (boxes or {}).items()
        ]
        if boxes is not None:
            message = camera_tracks(A, self._epoch, {}, tracks=seen, **changes)
            self.service.ingest.receive_tracks(tracks(message))
        self.service.ingest.receive_tracks(tracks(camera_tracks(B, self._epoch, {})))
        self.service.pulses.newest = end_of_epoch(self._epoch, STRIDE)
        self.service.decide()
        self._epoch += 1

    def regions(self) -> Regions:
        """Return the regions of all frames that are decided."""
        state = self.service.decision_state
        return [frame for first in self.seen for frame in state.occupied(A, first)]


def covers(region: tuple[int, float, float, float, float], box: Box) -> bool:
    left, top, right, bottom = region[1:]
    return left < box[0] and top < box[1] and right > box[2] and bottom > box[3]


def test_a_region_reaches_beyond_the_box_on_all_sides() -> None:
    site = Site()
    for _ in range(4):
        site.feed({1: [LARGE] * STRIDE})
    for frame in site.regions():
        assert frame is not None
        ((number, left, top, right, bottom),) = frame
        assert number == 1
        assert left <= LARGE[0] - 3.2
        assert right >= LARGE[2] + 3.2
        assert top <= LARGE[1] - 8
        assert bottom >= LARGE[3] + 8
    site.service.close()


def test_people_are_hidden_before_they_are_detected_and_after() -> None:
    site = Site()
    absent: list[Box | None] = [None] * STRIDE
    for epoch in range(14):
        site.feed({1: [SMALL] * STRIDE if epoch in (3, 4) else absent} if 3 <= epoch < 5 else {})
    detected = range(3 * STRIDE, 5 * STRIDE)
    for pulse, frame in enumerate(site.regions()):
        assert frame is not None
        near = detected.start - STRIDE <= pulse < detected.stop + HOLD
        far = not detected.start - HOLD <= pulse < detected.stop + HOLD
        if near:
            assert any(covers(region, SMALL) for region in frame), pulse
        assert not (far and frame), pulse
    site.service.close()


def test_a_person_whom_the_tracker_still_follows_stays_hidden_where_they_were() -> None:
    site = Site()
    for epoch in range(14):
        site.feed({1: [SMALL if epoch < 2 else None] * STRIDE})
    assert all(frame and covers(frame[0], SMALL) for frame in site.regions())
    site.service.close()


def test_between_two_boxes_the_region_moves() -> None:
    site = Site()
    away: Box = (SMALL[0] + 30, SMALL[1], SMALL[2] + 30, SMALL[3])
    for epoch in range(6):
        box = SMALL if epoch < 2 else away
        site.feed({1: [box, None, None, None, box] if epoch == 2 else [box] * STRIDE})
    lefts = [frame[0][1] for frame in site.regions() if frame]
    assert lefts[0] < 10 < lefts[-1]
    site.service.close()


def test_a_track_without_a_number_is_hidden() -> None:
    site = Site()
    site.service.decider.people.numbers = (  # type: ignore[method-assign]
        lambda keys, _, frames: np.full((len(keys), frames), -1)
    )
    for _ in range(4):
        site.feed({1: [SMALL] * STRIDE})
    assert all(frame and frame[0][0] == -1 and covers(frame[0], SMALL) for frame in site.regions())
    site.service.close()


def raw(epoch: int, *boxes: Box) -> list[RawDetections]:
    """Return the same detections in all frames of an epoch."""
    packed = pack_detections(np.array(boxes), np.full(len(boxes), 0.5))
    return [RawDetections(pulse=epoch * STRIDE + at, boxes=packed) for at in range(STRIDE)]


def test_whom_no_track_follows_is_hidden_around_the_time_of_the_detection() -> None:
    alone: Box = (40.0, 5.0, 50.0, 35.0)
    site = Site()
    for epoch in range(14):
        site.feed({1: [SMALL] * STRIDE}, detections=raw(epoch, SMALL, alone) if epoch == 6 else [])
    seen = {
        pulse: [region for region in frame or [] if region[0] < 0]
        for pulse, frame in enumerate(site.regions())
    }
    hidden = [pulse for pulse, regions in seen.items() if regions]
    assert hidden == [*range(hidden[0], 7 * STRIDE + UNSEARCHED)]
    assert hidden[0] < 6 * STRIDE, "as far ahead as is known"
    assert all(covers(region, alone) for pulse in hidden for region in seen[pulse])
    assert all(len(seen[pulse]) == 1 for pulse in hidden)


def test_detections_of_those_whom_tracks_follow_and_of_people_who_are_close_hide_nobody_else() -> None:
    both: Box = (SMALL[0] - 2, SMALL[1] - 2, SMALL[2] + 6, SMALL[3])
    site = Site()
    for epoch in range(8):
        site.feed({1: [SMALL] * STRIDE}, detections=raw(epoch, SMALL, both))
    assert all(len(frame or []) == 1 for frame in site.regions())


def test_nothing_is_known_where_the_camera_has_not_looked_for_long() -> None:
    site = Site()
    blind = range(4, 12)
    for epoch in range(16):
        frames = list(range(epoch * STRIDE, (epoch + 1) * STRIDE))
        site.feed({}, without_detection=frames if epoch in blind else [])
    regions = site.regions()
    for pulse, frame in enumerate(regions):
        last, then = blind.start * STRIDE - 1, blind.stop * STRIDE
        if pulse <= last + UNSEARCHED or pulse >= then - STRIDE:  # the look-ahead is short
            assert frame is not None, pulse
        elif pulse < then - UNSEARCHED:
            assert frame is None, pulse
    site.service.close()


def test_nothing_is_known_while_joint_tracks_are_late(monkeypatch: pytest.MonkeyPatch) -> None:
    site = Site()
    late = range(4, 12)
    step = site.service.decider.step
    monkeypatch.setattr(
        site.service.decider,
        "step",
        lambda epoch: step(without_tracks(epoch, {A}) if epoch.number in late else epoch),
    )
    for _ in range(16):
        site.feed({1: [SMALL] * STRIDE})
    for pulse, frame in enumerate(site.regions()):
        if pulse < late.start * STRIDE + UNSEARCHED or pulse >= late.stop * STRIDE:
            assert frame is not None, pulse
            assert any(covers(region, SMALL) for region in frame), pulse
        elif pulse < late.stop * STRIDE - UNSEARCHED:
            assert frame is None, pulse
    site.service.close()


def test_whom_a_jointly_tracked_camera_follows_alone_is_hidden_too(monkeypatch: pytest.MonkeyPatch) -> None:
    site = Site()
    occupied = site.service.decider._occupied
    assert occupied is not None
    take = occupied.take

    def take_joint(epoch: Epoch) -> None:
        own = {A: camera_tracks(A, epoch.number, {4: SMALL, 5: LARGE})}
        take(replace(epoch, joint=JointEpoch(cast("JointTracks", None), own)))

    monkeypatch.setattr(occupied, "take", take_joint)
    for _ in range(5):
        site.feed({1: [SMALL] * STRIDE})
    for frame in site.regions():
        assert frame is not None
        assert [region[0] for region in frame] == [1, -1]
        assert covers(frame[1], LARGE)
    site.service.close()


def test_nothing_is_known_of_a_camera_that_reports_nothing() -> None:
    site = Site()
    for _ in range(4):
        site.feed({})
    for _ in range(10):
        site.feed(None)
    regions = site.regions()
    assert regions[0] == []
    assert regions[-1] is None
    site.service.close()


def test_without_blurred_viewers_no_regions_are_kept() -> None:
    service = FedService(small_config())
    service.connect_cameras(*CAMERAS)
    for epoch in range(4):
        service.feed(epoch, {A: {1: SMALL}, B: {1: LARGE}})
    assert service.decision_state.occupied(A, 0) == []
    service.close()
