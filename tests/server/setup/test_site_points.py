"""Marked points beside a present calibration: who keeps it, who is left out, and what is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fakes.setup.room_points import PLACES, error_of, homography, pairs
from server.config.loader import load_config
from server.setup.marked_points import apply_points, calibrate_from_points, present_calibration
from server.setup.site_cameras import rename_camera
from server.system.errors import UserError

TEXT = "# mine\ncameras: [{id: c0, source: 'scene:room'}, {id: c1, source: 'scene:room'}]\n"
TURNED = np.array([[0.0, -1.0, 20.0], [1.0, 0.0, 7.0], [0.0, 0.0, 1.0]])
"""To other coordinates of the floor."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


def calibrated(path: Path, unit: str | None = "m", other: Any = None) -> Path:
    """Calibrate both cameras of the site, optionally in other coordinates."""
    matrices = [(np.eye(3) if other is None else other) @ homography(camera) for camera in (0, 1)]
    content = {"homography": {f"c{at}": matrix.tolist() for at, matrix in enumerate(matrices)}}
    (path.parent / "hall.json").write_text(json.dumps(content if unit is None else {"unit": unit, **content}))
    path.write_text(f"{TEXT}ground: hall.json\n")
    return path


def ground_of(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((path.parent / "site.ground.json").read_text())
    return content


def points(**cameras: Any) -> dict[str, Any]:
    return {"unit": "m", "cameras": cameras}


def test_two_cameras_get_the_scenes_homographies_and_the_file_keeps_the_points(path: Path) -> None:
    marked = points(c0=pairs(0), c1=pairs(1))
    apply_points(path, marked, present_calibration(path).digest)
    for at, camera in enumerate(load_config(path).cameras):
        assert error_of(camera.ground, at) < 0.05
        assert camera.ground_unit == "m"
    assert path.read_text() == f"{TEXT}\nground: site.ground.json\n"
    present = present_calibration(path)
    assert present.points == marked["cameras"]
    assert present.ground.unit == "m"
    rename_camera(path, "c1", "door")
    assert present_calibration(path).points == {"c0": pairs(0), "door": pairs(1)}


@pytest.mark.parametrize(
    ("unit", "other", "marked", "kept"),
    [
        ("m", None, pairs(0), True),
        (None, None, pairs(0), False),
        ("cm", None, pairs(0), False),
        ("m", TURNED, pairs(0), False),
        ("m", None, pairs(0, *PLACES[:4]), True),
    ],
)
def test_a_camera_without_points_keeps_a_homography_in_the_same_coordinates_only(
    path: Path, unit: str | None, other: Any, marked: Any, kept: bool
) -> None:
    calibrated(path, unit, other)
    report = calibrate_from_points(points(c0=marked), present_calibration(path)).report
    found = json.loads(report.ground)["homography"]
    assert ("c1" in found) is kept
    assert report.lines[1].startswith("c1: has no points and keeps" if kept else "c1: left out: ")
    if kept:
        assert error_of(found["c1"], 1) < 1e-6


def test_where_one_camera_has_moved_another_one_shows_that_the_coordinates_are_the_same(path: Path) -> None:
    calibrated(path)
    moved = [{**pair, "image": [320 - pair["image"][0], pair["image"][1]]} for pair in pairs(1)]
    mirrored = [{**pair, "floor": [11 - pair["floor"][0], pair["floor"][1]]} for pair in moved]
    path.write_text(path.read_text().replace("}]", "}, {id: c2, source: 'scene:room'}]"))
    content = json.loads((path.parent / "hall.json").read_text())
    content["homography"]["c2"] = content["homography"]["c0"]
    (path.parent / "hall.json").write_text(json.dumps(content))
    alone = calibrate_from_points(points(c1=mirrored), present_calibration(path)).report
    assert list(json.loads(alone.ground)["homography"]) == ["c1"]
    both = calibrate_from_points(points(c1=mirrored, c0=pairs(0)), present_calibration(path)).report
    assert sorted(json.loads(both.ground)["homography"]) == ["c0", "c1", "c2"]
    assert both.lines[2] == (
        "c2: has no points and keeps its present homography: the points of c0 agree with it"
    )


def test_a_calibration_that_was_changed_meanwhile_is_not_overwritten(path: Path) -> None:
    marked, before = points(c0=pairs(0)), present_calibration(path).digest
    apply_points(path, points(c0=pairs(0), c1=pairs(1)), before)
    text = (path.parent / "site.ground.json").read_text()
    with pytest.raises(UserError, match="was changed meanwhile: calibrate again"):
        apply_points(path, marked, before)
    assert (path.parent / "site.ground.json").read_text() == text
    apply_points(path, marked, present_calibration(path).digest)
    assert [file.read_text() for file in path.parent.glob("site.ground.2*.json")] == [text]


@pytest.mark.parametrize(
    ("marked", "error"),
    [
        ({}, 'has no {"cameras"'),
        (points(), "the points: has no pairs of points"),
        (points(c7=pairs(0)), "the configuration has no camera 'c7' (any more): remove its points"),
        (points(c0=pairs(0, *PLACES[:3])), "camera c0: 3 pairs; at least 4 are needed"),
        (points(c0=pairs(0, *((x, 3.0 + x / 4) for x in (4.0, 5.0, 6.0, 7.0)))), "are on a line"),
        (
            points(c0=[{"image": [1, 2], "floor": [float("nan"), 1]}]),
            "c0: pair 1: 1, 2, nan, 1: are not four",
        ),
        (points(c0=[{"image": [1, 2], "floor": [10**400, 1]}]), "are not four numbers"),
        (
            points(c0=[*pairs(0), {"image": [330, 20], "floor": [1, 1], "name": "place 7"}]),
            "c0: place 7: 330",
        ),
        ({**points(c0=pairs(0)), "unit": "metres"}, "unit: 'metres' is not understood; did you mean 'm'?"),
        (points(c0=pairs(0) * 200), "has more than 1000 points"),
    ],
)
def test_invalid_points_are_one_line(path: Path, marked: Any, error: str) -> None:
    with pytest.raises(UserError) as refused:
        calibrate_from_points(marked, present_calibration(path), {"c0": (320, 180)})
    assert error in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_a_wrong_point_is_called_by_its_name(path: Path) -> None:
    named = [{**pair, "name": f"place {10 * at}"} for at, pair in enumerate(pairs(0, *PLACES, (6.0, 5.0)))]
    named[2]["floor"] = [1.0, 1.0]
    with pytest.raises(
        UserError, match=r"camera c0: place 20 \(image .*, floor 1 1\) contradicts the others"
    ):
        calibrate_from_points(points(c0=named), present_calibration(path))


def test_points_above_the_horizon_are_named(path: Path) -> None:
    crossed = pairs(0, *PLACES[:4])
    crossed[0]["floor"], crossed[1]["floor"] = crossed[1]["floor"], crossed[0]["floor"]
    with pytest.raises(UserError, match=r"pair \d would be above the horizon"):
        calibrate_from_points(points(c0=crossed), present_calibration(path))
