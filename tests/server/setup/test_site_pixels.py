"""Settings in pixels of the site's picture follow when its size changes; nothing else in pixels does."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fakes.paths import CONFIGS
from server.config.config_diff import changed_keys
from server.config.loader import load_config
from server.media.letterbox import Letterbox
from server.setup.site_pixels import Size, find_change
from server.setup.site_settings import StreamFormatChoice, save_choice
from server.system.errors import UserError

REFERENCE = (CONFIGS / "demo.yaml").read_text(encoding="utf-8")
KEY = re.compile(r"^( *)(?:#(?=\w))?(- )?(\w+):(.*)$")
OWN, WORKING, COUNTED = "the camera's own picture", "a working image of this width", "no length or place"
FOLLOWS = {
    "detect.ignore",
    "track.costs.displacement",  # if its unit is pixels
    "track.costs.gate",
    "track.costs.layout",
    "track.costs.conflict_distance",
}
STAYS = {
    "site.width": "what is changed",
    "site.height": "what is changed",
    "cameras.ignore": OWN,
    "cameras.ground": OWN,
    "ground": OWN,
    "zones": OWN,
    "detect.work_width": WORKING,
    "detect.static_foreground.min_area": WORKING,
    "track.temporal.blobs.work_width": WORKING,
    "detect.onnx.input_size": "the network's input",
    "track.costs.displacement_unit": "a unit",
    "detect.median.threshold": COUNTED,
    "detect.static_foreground.settled_after_s": COUNTED,
    "detect.static_foreground.settled_still_s": COUNTED,
    "detect.box_filter.background_cost": COUNTED,
    "track.temporal.blobs.threshold": COUNTED,
    "access.blur": COUNTED,
}
"""Settings whose explanation speaks of pixels, and of what."""
TEXT = """\
site:
  name: hall
  width: 640  # of the shop
  height: 360
cameras:
  - id: c0
    source: rtsp://10.0.0.1/
    ignore: [[[0, 0], [90, 0], [90, 40]]]
  - {id: c1, source: rtsp://10.0.0.2/}
ground: ground.json
zones:
  - {id: till, camera: c0, area: [[0, 0], [90, 0], [90, 40]], margin: 12}
detect:
  work_width: 320  # quick
  ignore: [[[0, 300], [640, 300], [640, 360.5]]]  # the clock
  median: {threshold: 20}
  static_foreground: {min_area: 50, settled_after_s: 5, settled_still_s: 12}
  box_filter: {background_cost: 0.4}
  onnx: {input_size: 320}
track:
  costs:
    displacement: 0.01  # the paper's
    displacement_unit: pixels
    gate: 80
    layout: 0.5
    conflict_distance: 60
  temporal: {blobs: {work_width: 240, threshold: 6}}
"""
GROUND = {"homography": {"c1": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 1]]}}
LARGER = StreamFormatChoice("hall", 25.0, 1280, 720)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    (tmp_path / "ground.json").write_text(json.dumps(GROUND))
    return path


def settings_in_pixels() -> set[str]:
    """Return the settings of the reference whose explanation, beside or above them, speaks of pixels."""
    found, place, above = set(), list[tuple[int, str]](), ""
    for line in REFERENCE.splitlines():
        setting = KEY.match(line)
        if setting is None:
            above = above + line if line.lstrip().startswith("# ") else ""
            continue
        depth = len(setting[1]) + len(setting[2] or "")
        place = [*((outer, name) for outer, name in place if outer < depth), (depth, setting[3])]
        if "pixel" in above + setting[4].partition("  # ")[2]:
            found.add(".".join(name for _, name in place))
        above = ""
    return found


def test_of_every_setting_that_is_explained_in_pixels_it_is_known_whether_it_follows() -> None:
    assert settings_in_pixels() - FOLLOWS - STAYS.keys() == set()
    assert {
        "detect.ignore",
        "cameras.ignore",
        "zones",
        "track.costs.conflict_distance",
    } <= settings_in_pixels()


def test_exactly_what_is_in_pixels_of_the_sites_picture_follows_its_size(path: Path) -> None:
    before = load_config(path)
    save_choice(path, LARGER)
    after = load_config(path)
    assert set(changed_keys(before, after)) == {"site.width", "site.height", *FOLLOWS}
    assert after.detect.ignore == (((0, 600), (1280, 600), (1280, 721)),)
    costs = after.track.costs
    assert (costs.displacement, costs.gate, costs.layout, costs.conflict_distance) == (0.005, 160, 0.25, 120)
    for comment in ("# of the shop", "# quick", "# the clock", "# the paper's"):
        assert comment in path.read_text()


def test_defaults_and_heights_stay(path: Path) -> None:
    path.write_text(
        "cameras: [{id: c0, source: rtsp://10.0.0.1/}]\ntrack: {costs: {displacement: 3.0, gate: 0.7}}\n"
    )
    before = load_config(path)
    save_choice(path, StreamFormatChoice("site", 25.0, 1280, 720))
    assert changed_keys(before, load_config(path)) == ("site.width", "site.height")


@pytest.mark.parametrize(
    ("after", "pictures"),
    [
        ((1280, 720), [(1920, 1080), (640, 480)]),
        ((854, 480), []),
        ((640, 480), [(1920, 1080), (1280, 720)]),
        ((640, 480), [(800, 600)]),
        ((360, 640), [(480, 640)]),
    ],
)
def test_what_a_camera_shows_in_an_area_is_the_same_before_and_after(
    after: Size, pictures: list[Size]
) -> None:
    change = find_change((640, 360), after, pictures)
    assert change is not None
    points = np.array([[100.0, 100.0], [320.0, 200.0], [400.0, 300.0]])
    for picture in pictures:
        shown = Letterbox(picture, (640, 360)).site_to_camera(points)
        seen = Letterbox(picture, after).site_to_camera(change.move(points))
        np.testing.assert_allclose(seen, shown, atol=2.0 * max(picture) / max(after))


@pytest.mark.parametrize(
    ("pictures", "reason"),
    [
        ({"c0": (1920, 1080), "c1": (640, 480)}, "not all cameras' pictures will lie alike"),
        ({"c0": (1920, 1080)}, "the picture of camera c1"),  # it is away; it may have another shape
        ({}, "the picture of camera c0, c1"),
    ],
)
def test_what_cannot_follow_is_one_line_and_changes_nothing(
    path: Path, pictures: dict[str, Size], reason: str
) -> None:
    line = rf"^detect\.ignore, track\.costs\.displacement, .*{reason}: keep its shape"
    with pytest.raises(UserError, match=line) as refused:
        save_choice(path, StreamFormatChoice("hall", 25.0, 640, 480), None, pictures)
    assert len(str(refused.value).splitlines()) == 1
    assert path.read_text() == TEXT
    save_choice(path, StreamFormatChoice("shop", 12.5, 640, 360), None, pictures)  # the size stays


def test_another_shape_is_followed_where_all_cameras_sizes_are_known(path: Path) -> None:
    sizes = dict.fromkeys(("c0", "c1", "removed"), (1920, 1080)) | {"removed": (640, 480)}
    save_choice(path, StreamFormatChoice("hall", 25.0, 640, 480), None, sizes)
    assert load_config(path).detect.ignore == (((0, 360), (640, 360), (640, 420.5)),)


@pytest.mark.parametrize(
    "settings",
    [
        "ignore: [[[0, 0], [9, 0], [9, 9]]]}]",
        "ground: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}]",
        "}]\nzones: [%s]",
    ],
)
def test_a_drawn_scene_with_settings_in_its_pixels_keeps_its_size(path: Path, settings: str) -> None:
    zone = "{id: till, camera: c0, area: [[0, 0], [9, 0], [9, 9]]}"
    path.write_text(f"cameras: [{{id: c0, source: 'scene:room', {settings.replace('%s', zone)}\n")
    with pytest.raises(UserError, match=r"^camera c0: its scene is drawn in the site's size"):
        save_choice(path, LARGER)
