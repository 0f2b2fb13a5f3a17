"""The benchmark of coincidences keeps two cameras of one floor, and knows why it refuses others."""

from __future__ import annotations

import numpy as np

from benchmarks.calibration.coincidence import RecordedFloor, WalkedPair, judge_pair, pairs_of_recording, row
from fakes.bestview.walkers import camera_at, random_path, recorded_walk

WEST, SOUTH = camera_at(-4, -1), camera_at(1, -4.5, focal=0.7)
FPS = 25.0


def recorded_floor(frames: int) -> RecordedFloor:
    random = np.random.default_rng(2)
    path = random_path(random, frames)
    walks = tuple(
        recorded_walk(name, camera, [path], random) for name, camera in (("west", WEST), ("south", SOUTH))
    )
    return RecordedFloor(walks, {"west": WEST.floor_homography(), "south": SOUTH.floor_homography()}, FPS)


def test_two_cameras_of_one_floor_are_kept_and_misplaced_ones_are_counted() -> None:
    floor = recorded_floor(400)
    right = judge_pair(WalkedPair("right", floor.walks, floor.truth, FPS), 0.0)
    assert (right.reason, right.misplaced) == (None, False)
    assert right.held_out > 0.5
    wrong_truth = {"west": floor.truth["west"], "south": floor.truth["west"]}
    misplaced = judge_pair(WalkedPair("right", floor.walks, wrong_truth, FPS), 0.0)
    assert misplaced.misplaced
    cells = row("right", [right, misplaced])
    assert cells[:2] == ["right", "2"]
    assert cells[2:10] == ["0", "0", "0", "0", "0", "0", "2", "1"]


def test_halves_of_a_recording_are_of_the_same_length_and_share_no_moment() -> None:
    floor = recorded_floor(300)
    same, *later = pairs_of_recording("walk", floor)
    assert same.walks == floor.walks
    assert [tuple(walk.camera for walk in pair.walks) for pair in later] == [
        ("west", "south"),
        ("south", "west"),
    ]
    half = max(walk.end_frame for walk in floor.walks) // 2
    for pair in later:
        assert pair.truth is None
        first, second = (walk.tracks for walk in pair.walks)
        assert min(track.first_frame for track in (*first, *second)) >= 0
        assert max(track.end_frame for track in (*first, *second)) <= half
        whole = next(walk for walk in floor.walks if walk.camera == pair.walks[1].camera)
        moment = second[0].first_frame
        original = next(track for track in whole.tracks if track.end_frame > half + moment)
        np.testing.assert_array_equal(
            second[0].boxes[0], original.boxes[half + moment - original.first_frame]
        )
