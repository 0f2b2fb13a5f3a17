"""The calibration benchmark: the overlap of two cameras by the ground truth, and a pair not to be aligned."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.calibration.calibration_errors import camera_overlaps
from benchmarks.calibration.joint_identities import joint_idf1, moved_ground
from benchmarks.common.public_detections import Recording, track
from bestview.calibration import CalibrationError, WalkSettings, calibrate_from_walks
from server.cli.calibrate.walk_input import VideoFormat, walks_from_tracks
from tracking.motchallenge import MotRow, read_rows, write_rows

HEIGHT = 60.0


def write_truth(folder: Path, camera: str, frames: Sequence[int], feet: np.ndarray) -> None:
    """Write the ground truth of a person with foot points ``(F, 2)``, pixels."""
    rows = [
        MotRow(frame + 1, 1, x - 10, bottom - HEIGHT, 20, HEIGHT)
        for frame, (x, bottom) in zip(frames, feet, strict=True)
    ]
    write_rows(folder / f"{camera}.txt", rows)


def test_a_plane_is_fitted_despite_hidden_feet_and_people_at_other_times_do_not_overlap(
    tmp_path: Path,
) -> None:
    random = np.random.default_rng(1)
    feet = random.uniform((100, 100), (500, 300), (80, 2))
    rotated = 640 - feet  # by 180 degrees, which is a homography
    rotated[:20, 1] -= 25  # feet hidden by a desk
    write_truth(tmp_path, "a", range(80), feet)
    write_truth(tmp_path, "b", range(80), rotated)
    write_truth(tmp_path, "later", range(80, 160), feet)
    overlaps = camera_overlaps(tmp_path, ("a", "b", "later"), (640, 700))
    assert (overlaps["a", "b"].people, overlaps["a", "b"].boxes) == (1, 80)
    assert overlaps["a", "b"].residual == pytest.approx(0.0, abs=1e-6)
    for other in ("a", "b"):
        assert (overlaps[other, "later"].people, overlaps[other, "later"].boxes) == (0, 0)
        assert np.isnan(overlaps[other, "later"].residual)


def test_a_plane_is_fitted_despite_people_who_sit_in_a_row_with_hidden_feet(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    walked, row = (
        random.uniform((100, 300), (500, 400), (60, 2)),
        random.uniform((480, 100), (500, 110), (50, 2)),
    )
    feet = np.concatenate([walked, row])
    write_truth(tmp_path, "a", range(110), feet)
    seen = 640 - feet
    seen[60:] -= (0, 5 * HEIGHT)
    write_truth(tmp_path, "b", range(110), seen)
    assert camera_overlaps(tmp_path, ("a", "b"), (640, 700))["a", "b"].residual == pytest.approx(
        0.0, abs=1e-6
    )


def test_no_plane_fits_feet_that_are_hidden_at_random(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    feet = random.uniform((100, 100), (500, 300), (80, 2))
    write_truth(tmp_path, "a", range(80), feet)
    write_truth(tmp_path, "b", range(80), feet + random.normal(0, HEIGHT, (80, 2)) * (0, 1) + (0, 200))
    residual = camera_overlaps(tmp_path, ("a", "b"), (640, 900))["a", "b"].residual
    assert residual > 0.2


def calibrated_hall(folder: Path) -> BenchmarkScene:
    """Return two cameras, a meter apart and 3 m high, whose detections are the true boxes of two people.

    The horizon is at y = 50, the focal length 500 pixels.
    """
    truth = {}
    for camera, x in (("c0", 0.0), ("c1", 1.0)):
        truth[camera] = [
            MotRow(frame + 1, person, *person_box(0.04 * frame - x, distance))
            for frame in range(50)
            for person, distance in ((1, 5.0), (2, 8.0))
        ]
        write_rows(folder / f"{camera}.txt", truth[camera])
    matrices = {
        camera: [[3.0, x, -320.0 * 3.0 - 50.0 * x], [0.0, 0.0, 1500.0], [0.0, 1.0, -50.0]]
        for camera, x in (("c0", 0.0), ("c1", 1.0))
    }
    ground = folder / "ground.json"
    ground.write_text(json.dumps({"unit": "m", "homography": matrices}))
    content = {
        "site": {"name": "hall", "fps": 25, "width": 640, "height": 480},
        "cameras": [{"id": camera, "source": "scene:none"} for camera in truth],
        "ground": str(ground),
    }
    return BenchmarkScene(
        "hall", "two views", content, truth, 0.25, {camera: folder / f"{camera}.txt" for camera in truth}
    )


def person_box(x: float, distance: float) -> tuple[float, float, float, float]:
    """Return left, top, width and height of a person at a place before the camera, meters."""
    pixels = 500.0 / distance
    width, height = 0.5 * pixels, 1.7 * pixels
    return 320.0 + x * pixels - width / 2.0, 50.0 + 3.0 * pixels - height, width, height


def test_each_run_moves_the_calibration_in_another_way_and_by_little(tmp_path: Path) -> None:
    scene = calibrated_hall(tmp_path)
    ground = Path(scene.content["ground"])
    given = np.array(json.loads(ground.read_text())["homography"]["c0"])
    corner, shown = np.array([640.0, 480.0, 1.0]), []
    for seed in (1, 2):
        text = moved_ground(ground, scene.sizes, seed)
        assert text == moved_ground(ground, scene.sizes, seed)
        moved = json.loads(text)
        assert moved["unit"] == "m"
        point = np.linalg.solve(given, np.array(moved["homography"]["c0"]) @ corner)
        shown.append(point[:2] / point[2])
        assert 0.0 < np.hypot(*(shown[-1] - corner[:2])) < 2.5  # pixels
    assert not np.allclose(*shown)


def test_people_apart_keep_their_ids_however_the_calibration_is_moved(tmp_path: Path) -> None:
    found = joint_idf1(calibrated_hall(tmp_path), 2, tmp_path)
    assert [found.given, *found.moved] == pytest.approx([1.0] * 3, abs=0.06)


@pytest.mark.slow
def test_people_with_hidden_feet_who_agree_in_one_aisle_are_refused(
    shared_data: Path, tmp_path: Path
) -> None:
    tracks, fps, end = tmp_path / "tracks", 30.0, 1350
    tracks.mkdir()
    for camera in ("IP2", "IP5"):
        files = [shared_data / "auditorium" / kind / f"{camera}.txt.gz" for kind in ("det", "gt")]
        detected = tmp_path / f"{camera}.txt"
        write_rows(detected, [row for row in read_rows(files[0]) if row.frame <= end])
        write_rows(tracks / f"{camera}.txt", track(Recording(camera, detected, files[1], fps)))
    walked = walks_from_tracks([tracks], VideoFormat((1920, 1080), fps))
    with pytest.raises(CalibrationError, match="IP2 and IP5: in a quarter of the walk they agree about only"):
        calibrate_from_walks(walked.walks, WalkSettings.at_rate(fps, 0.0))
