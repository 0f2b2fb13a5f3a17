"""The benchmark of view selection speed: it runs complete decisions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.view_selection_speed.__main__ import ProgramSize, frame_time
from benchmarks.view_selection_speed.whole_decision import SimulatedCrowd, decision_times
from server.config.loader import build_config


def test_each_person_is_visible_to_the_given_number_of_cameras() -> None:
    cameras = [{"id": f"c{number}", "source": "scene:room"} for number in range(4)]
    config = build_config({"cameras": cameras}, where="test", folder=Path())
    for epoch in SimulatedCrowd(people=7, cameras=4, seen_by=2).epochs(config, 3):
        seen = [track.id for message in epoch.tracks.values() for track in message.tracks]
        assert np.array_equal(np.bincount(seen), np.full(7, 2))


def test_a_decision_is_the_sum_of_its_stages() -> None:
    spent = decision_times(SimulatedCrowd(people=20, cameras=3, seen_by=2), 10, 4, all_terms=True)
    stages = (spent.decoding, spent.quality, spent.costs, spent.selection, spent.bookkeeping)
    assert min(*stages, spent.people, spent.publishing) > 0
    assert spent.decision == sum(stages)


def test_longer_gops_and_fewer_people_take_less_time_per_frame() -> None:
    assert 0 < frame_time(ProgramSize(50, 4, 25, 10, 0), 3) < frame_time(ProgramSize(2000, 16, 25, 1, 0), 3)
