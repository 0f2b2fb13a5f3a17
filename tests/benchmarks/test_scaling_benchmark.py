"""The scaling benchmark: the simulated hall and its cameras, and (slow) a small site."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from benchmarks.scaling.__main__ import exponent
from benchmarks.scaling.simulated_hall import STRIDE, WINDOW, SimulatedHall, SimulatedTracker
from benchmarks.scaling.simulated_site import measure_load
from benchmarks.scaling.timed_service import REST, STAGES, ServiceTimes
from bestview import foot_points, to_ground
from server.messaging.messages import CameraTracks
from server.service.ingest.validation import is_plausible


@pytest.mark.parametrize("cameras", [4, 25])
def test_every_camera_sees_about_as_many_as_asked_for_wherever_they_walk(cameras: int) -> None:
    hall = SimulatedHall(cameras, 20)
    for first in (0, 5000):
        places = hall.places(first, first)
        seen = [hall.view(camera, places, 0).people.size for camera in range(cameras)]
        assert np.mean(seen) == pytest.approx(20, rel=0.35)
        assert min(seen) > 0


def test_boxes_stand_where_people_are() -> None:
    hall = SimulatedHall(9, 10)
    places = hall.places(100, 114)
    for camera in range(9):
        view = hall.view(camera, places, 3)
        there = ~np.isnan(view.boxes[..., 0])
        found = to_ground(hall.grounds[camera], foot_points(view.boxes))
        off = np.hypot(*np.moveaxis(found - places[view.people], -1, 0))[there]
        assert np.median(off) < 0.5


def test_nobody_walks_out_of_the_hall_or_jumps() -> None:
    hall = SimulatedHall(4, 10)
    places = hall.places(0, 3000)
    assert places.min() >= 0
    assert places.max() <= 20.0
    assert np.hypot(*np.moveaxis(np.diff(places, axis=1), -1, 0)).max() < 0.06


def test_a_tracker_says_what_the_service_takes_and_renames_who_comes_back() -> None:
    hall = SimulatedHall(4, 10)
    tracker = SimulatedTracker(hall, 1, boot=7)
    ids: dict[tuple[float, ...], set[int]] = {}
    for epoch in range(2, 200):
        last = (epoch + 1) * STRIDE - 1
        message = tracker.message(epoch, hall.places(last + 1 - WINDOW, last))
        assert msgspec.json.decode(msgspec.json.encode(message), type=CameraTracks) == message
        assert is_plausible(message, STRIDE)
        for track in message.tracks:
            [look] = track.appearance
            ids.setdefault(look.histogram, set()).add(track.id)
    assert max(map(len, ids.values())) > 1
    assert len(set.union(*ids.values())) == sum(map(len, ids.values()))


def test_growth_is_the_exponent_of_a_power_law() -> None:
    assert exponent([4, 16, 64], [8.0, 64.0, 512.0]) == pytest.approx(1.5)
    assert np.isnan(exponent([4], [8.0]))


def test_a_process_that_has_said_nothing_yet_has_no_times(tmp_path: Path) -> None:
    assert ServiceTimes.read(tmp_path / "times.json") is None


@pytest.mark.slow
def test_a_small_site_is_carried_in_time(tmp_path: Path) -> None:
    load = measure_load(SimulatedHall(3, 5), 25.0, tmp_path / "site", settle=6, epochs=6)
    assert set(load.stages) == {*STAGES, REST}
    assert load.stages["identities"] > 0
    assert load.stages["splice"] > 0
    assert load.messages == pytest.approx(3 * (25 + 5), rel=0.3)
    assert 0 < load.milliseconds < 40
