"""Calibration from walks finds cameras from people's boxes alone, and refuses insufficient walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestview.calibration import CalibrationError, Floats, Walk, WalkSettings, WalkTrack, calibrate_from_walks
from bestview.calibration.pinhole import Pinhole
from fakes.bestview.walkers import SIZE, camera_at, error_on_floor, random_path, recorded_walk

WEST, SOUTH = camera_at(-4, -1), camera_at(1, -4.5, focal=0.7)
PERSON = 1.75
FPS = 25.0
SYNCHRONIZED = WalkSettings.at_rate(FPS, 0.0)
MIDDLE = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 2))


def walks(
    random: np.random.Generator, cameras: tuple[Pinhole, ...], paths: list[Floats], offsets: tuple[int, ...]
) -> list[Walk]:
    return [
        recorded_walk(f"c{number}", camera, paths, random, offset)
        for number, (camera, offset) in enumerate(zip(cameras, offsets, strict=True))
    ]


@pytest.mark.parametrize(("seed", "offset"), [(2, -19)])
def test_one_walking_person_calibrates_two_cameras_and_their_offset(seed: int, offset: int) -> None:
    random = np.random.default_rng(seed)
    given = walks(random, (WEST, SOUTH), [random_path(random, 450)], (0, offset))
    found = calibrate_from_walks(given, WalkSettings.at_rate(FPS, 1.2), PERSON)
    assert found.uncalibrated == ()
    errors = error_on_floor(
        [calibration.homography for calibration in found.cameras], (WEST, SOUTH), MIDDLE, PERSON
    )
    assert np.median(errors) < 0.1  # person heights
    assert errors.max() < 0.4
    assert found.cameras[0].offset == 0.0
    assert found.cameras[1].offset == pytest.approx(offset, abs=1.5)
    assert found.floor_error.median < 0.15


def test_several_unidentified_people_and_a_ghost_calibrate_as_well() -> None:
    random = np.random.default_rng(4)
    given = walks(random, (WEST, SOUTH), [random_path(random, 400) for _ in range(3)], (0, 0))
    box = np.array([300.0, 150.0, 330.0, 230.0])
    sway = 15 * np.sin(np.arange(400) / 9.0)[:, None] * np.array([1, 0.3, 1, 0.3])
    ghost = WalkTrack(0, box + sway)
    given[1] = replace(given[1], tracks=(*given[1].tracks, ghost))
    found = calibrate_from_walks(given, SYNCHRONIZED, PERSON)
    errors = error_on_floor(
        [calibration.homography for calibration in found.cameras], (WEST, SOUTH), MIDDLE, PERSON
    )
    assert np.median(errors) < 0.1
    assert [calibration.offset for calibration in found.cameras] == [0.0, 0.0]


def test_calibration_is_deterministic() -> None:
    random = np.random.default_rng(9)
    given = walks(random, (WEST, SOUTH), [random_path(random, 120)], (0, 0))
    brief = replace(SYNCHRONIZED, minimum_places=5.0, minimum_breadth=0.02, minimum_held_out=0.1)
    first, second = (calibrate_from_walks(given, brief, PERSON) for _ in range(2))
    for one, other in zip(first.cameras, second.cameras, strict=True):
        assert one.homography.tobytes() == other.homography.tobytes()


def test_a_camera_that_sees_other_people_is_not_calibrated() -> None:
    random = np.random.default_rng(8)
    given = walks(random, (WEST, SOUTH), [random_path(random, 300)], (0, 0))
    elsewhere = recorded_walk("c2", WEST, [random_path(random, 300)], random)
    found = calibrate_from_walks([given[0], elsewhere, given[1]], SYNCHRONIZED, PERSON)
    assert [calibration.camera for calibration in found.cameras] == ["c0", "c1"]
    (left_out,) = found.uncalibrated
    assert left_out.camera == "c2"
    assert "c2" in left_out.reason


def straight(frames: int) -> Floats:
    """Return a path back and forth on a line across both pictures."""
    along = 1.5 * np.sin(np.arange(frames) * 0.02)
    return np.column_stack([along, 0.4 * along])


def test_a_straight_line_is_refused() -> None:
    random = np.random.default_rng(1)
    given = walks(random, (WEST, SOUTH), [straight(400)], (0, 0))
    with pytest.raises(CalibrationError, match="c0 and c1: the walk that both saw is a straight line"):
        calibrate_from_walks(given, SYNCHRONIZED)


def test_standing_still_is_refused() -> None:
    random = np.random.default_rng(1)
    given = walks(random, (WEST, SOUTH), [np.zeros((400, 2))], (0, 0))
    with pytest.raises(CalibrationError, match=r"no person was tracked by both|walk longer where both see"):
        calibrate_from_walks(given, SYNCHRONIZED)


def test_people_seen_by_one_camera_after_the_other_are_refused() -> None:
    random = np.random.default_rng(1)
    given = walks(random, (WEST, SOUTH), [random_path(random, 300)], (0, -1000))
    with pytest.raises(CalibrationError, match="no person was tracked by both cameras at the same time"):
        calibrate_from_walks(given, SYNCHRONIZED)


def test_different_people_are_refused() -> None:
    random = np.random.default_rng(3)
    given = [
        recorded_walk(name, camera, [random_path(random, 400)], random)
        for name, camera in (("c0", WEST), ("c1", SOUTH))
    ]
    with pytest.raises(CalibrationError, match="c0 and c1"):
        calibrate_from_walks(given, SYNCHRONIZED)


def test_people_who_only_for_a_while_walk_like_others_elsewhere_are_refused() -> None:
    random = np.random.default_rng(5)
    path, later = random_path(random, 400), random_path(random, 400)
    alike = np.concatenate([path[:240], later[240:] - later[240] + path[240]])
    given = [recorded_walk("c0", WEST, [path], random), recorded_walk("c1", SOUTH, [alike], random)]
    with pytest.raises(CalibrationError, match="in a quarter of the walk they agree about only"):
        calibrate_from_walks(given, SYNCHRONIZED)


def test_a_camera_that_was_turned_during_the_walk_is_refused() -> None:
    random = np.random.default_rng(6)
    path = random_path(random, 450)
    turned = camera_at(1, -4.5, (1.0, 0.3), focal=0.7)
    before, after = (recorded_walk("c1", camera, [path], random) for camera in (SOUTH, turned))
    middle = 250
    kept = [
        WalkTrack(track.first_frame, track.boxes[: middle - track.first_frame])
        for track in before.tracks
        if track.first_frame < middle - 1
    ]
    kept += [
        WalkTrack(max(middle, track.first_frame), track.boxes[max(0, middle - track.first_frame) :])
        for track in after.tracks
        if track.end_frame > middle + 1
    ]
    given = [recorded_walk("c0", WEST, [path], random), replace(before, tracks=tuple(kept))]
    with pytest.raises(CalibrationError, match="in a quarter of the walk they agree about only"):
        calibrate_from_walks(given, SYNCHRONIZED)


def test_an_empty_walk_and_a_single_camera_are_refused() -> None:
    empty = [Walk(name, SIZE, ()) for name in ("c0", "c1")]
    with pytest.raises(CalibrationError, match="no person was tracked by both cameras at the same time"):
        calibrate_from_walks(empty, SYNCHRONIZED)
    with pytest.raises(CalibrationError, match="at least two cameras"):
        calibrate_from_walks(empty[:1], SYNCHRONIZED)
