"""The benchmark of view selection speed: it runs complete decisions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.view_selection_speed.selection_program import ProgramSize, frame_time
from benchmarks.view_selection_speed.whole_decision import SimulatedCrowd, decision_times
from server.config.loader import build_config


def test_everybody_is_seen_by_as_many_cameras_as_asked_for() -> None:
    cameras = [{"id": f"c{number}", "source": "scene:room"} for number in range(4)]
    config = build_config({"cameras": cameras}, where="test", folder=Path())
    for epoch in SimulatedCrowd(people=7, cameras=4, seen_by=2).epochs(config, 3):
        seen = [track.id for message in epoch.tracks.values() for track in message.tracks]
        assert np.array_equal(np.bincount(seen), np.full(7, 2))


def test_a_decision_is_the_sum_of_its_stages_and_less_than_all() -> None:
    spent = decision_times(SimulatedCrowd(people=20, cameras=3, seen_by=2), 10, 4, all_terms=True)
    stages = (spent.decoding, spent.quality, spent.costs, spent.selection, spent.rest)
    assert min(*stages, spent.people, spent.publishing) > 0
    assert spent.decision == sum(stages)


def test_a_choice_for_a_gop_is_shared_by_its_frames() -> None:
    assert 0 < frame_time(ProgramSize(50, 4, 25, 10, 0), 3) < frame_time(ProgramSize(2000, 16, 25, 1, 0), 3)
