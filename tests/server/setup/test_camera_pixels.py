"""What is in pixels of a camera's own picture follows when another address sends another size."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fakes.system.full_disk import files_of_at_most
from server.config.config_diff import changed_keys
from server.config.loader import load_config
from server.setup.camera_address import parse_address
from server.setup.session import TriedCamera, TriedStream
from server.setup.site_cameras import readdress_camera
from server.setup.trial_messages import StreamTrial
from server.system.errors import UserError

OLD = "rtsp://10.0.0.1/"
TEXT = f"""\
ground: ground.json
cameras:
- {{id: c0, source: '{OLD}', ignore: [[[0, 0], [90, 0], [90, 41]]]}}
- {{id: c1, source: 'rtsp://10.0.0.2/', ignore: [[[0, 0], [90, 0], [90, 40]]]}}
zones:
- {{id: till, camera: c0, area: [[0, 0], [90, 0], [90, 40]], margin: 12}}
- {{id: gate, camera: c0, line: [[0, 10], [90, 10]], inner: [45, 30]}}
- {{id: exit, camera: c1, area: [[0, 0], [90, 0], [90, 40]]}}
- {{id: floor, area: [[0, 0], [9, 0], [9, 4]]}}
"""
HOMOGRAPHY = [[0.01, 0.002, 1.0], [0.001, 0.02, -1.0], [0.0001, 0.0002, 1.0]]
POINTS = [
    {"image": [10, 20], "floor": [0, 0], "name": "pillar"},
    {"image": [600, 20], "floor": [5, 0]},
    {"image": [600, 300], "floor": [5, 5]},
    {"image": [10, 300], "floor": [0, 5]},
]
GROUND: dict[str, Any] = {
    "unit": "m",
    "homography": {"c0": HOMOGRAPHY, "c1": HOMOGRAPHY},
    "points": {"c0": POINTS, "c1": POINTS},
}
NAMES = "ignored areas, calibration, zone till and zone gate"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "ground.json").write_text(json.dumps(GROUND))
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


def readdress(path: Path, size: tuple[int, int], sizes: dict[str, tuple[int, int]]) -> str:
    """Change the address of c0 to one that sends pictures of a size."""
    trial = StreamTrial(width=size[0], height=size[1])
    tried = TriedCamera(1, "", TriedStream(parse_address("rtsp://10.0.0.9/live", "", ""), trial))
    return readdress_camera(path, "c0", tried, sizes)


def test_what_is_in_pixels_of_the_camera_is_scaled_with_its_picture_and_nothing_else(path: Path) -> None:
    before = load_config(path)
    note = readdress(path, (1280, 720), {OLD: (640, 360)})
    assert note == f"scaled from 640x360 to 1280x720: its {NAMES}"
    after = load_config(path)
    assert after.camera("c0").ignore == [[(0, 0), (180, 0), (180, 82)]]
    assert after.camera("c1") == before.camera("c1")
    till, gate, *others = after.zones
    assert (till.area, till.margin) == ([(0, 0), (180, 0), (180, 80)], 24)
    assert (gate.line, gate.inner) == ([(0, 20), (180, 20)], (90, 60))
    assert gate.border_margin == 2 * before.zones[1].border_margin, "the default is in pixels, too"
    assert others == list(before.zones[2:])


def test_a_pixel_of_the_larger_picture_has_the_place_of_the_smaller_ones(path: Path) -> None:
    readdress(path, (1280, 720), {OLD: (640, 360)})
    ground = json.loads((path.parent / "ground.json").read_text())

    def place(matrix: Any, pixel: tuple[float, float]) -> np.ndarray[Any, Any]:
        x, y, w = np.array(matrix) @ (*pixel, 1.0)
        return np.array([x / w, y / w])

    np.testing.assert_allclose(
        place(ground["homography"]["c0"], (200, 400)), place(HOMOGRAPHY, (100, 200)), rtol=1e-12
    )
    assert [pair["image"] for pair in ground["points"]["c0"]] == [
        [20, 40],
        [1200, 40],
        [1200, 600],
        [20, 600],
    ]
    assert ground["points"]["c0"][0]["name"] == "pillar"
    for part in ("homography", "points"):
        assert ground[part]["c1"] == GROUND[part]["c1"]
    (kept,) = path.parent.glob("ground.2*.json")
    assert json.loads(kept.read_text()) == GROUND


@pytest.mark.parametrize(
    ("size", "sizes", "note"),
    [
        (
            (640, 480),
            {OLD: (640, 360)},
            f"its picture's shape changes from 640x360 to 640x480: redo its {NAMES}",
        ),
        ((640, 480), {}, f"the size of its earlier picture is not known: check its {NAMES}"),
        ((640, 360), {OLD: (640, 360)}, ""),
    ],
    ids=["another shape", "unknown", "same size"],
)
def test_what_cannot_follow_or_need_not_stays_and_is_said(
    path: Path, size: tuple[int, int], sizes: dict[str, tuple[int, int]], note: str
) -> None:
    before = load_config(path)
    assert readdress(path, size, sizes) == note
    assert changed_keys(before, load_config(path)) == ("cameras.c0.source", "cameras.c0.options")
    assert json.loads((path.parent / "ground.json").read_text()) == GROUND


def test_if_the_configuration_cannot_be_written_the_ground_stays_as_well(path: Path) -> None:
    text = TEXT + 100 * f"# {'x' * 80}\n"
    path.write_text(text)
    with files_of_at_most(4096), pytest.raises(UserError, match="cannot write there"):
        readdress(path, (1280, 720), {OLD: (640, 360)})
    assert path.read_text() == text
    assert json.loads((path.parent / "ground.json").read_text()) == GROUND
    assert not list(path.parent.glob("ground.2*.json"))


def test_nothing_is_said_of_a_camera_without_anything_in_pixels(path: Path) -> None:
    path.write_text(f"cameras: [{{id: c0, source: '{OLD}'}}]\n")
    assert readdress(path, (640, 480), {}) == ""
