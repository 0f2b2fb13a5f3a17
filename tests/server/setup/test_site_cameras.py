"""Cameras are added to a configuration, renamed and removed; the rest and calibration stay right."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest
import yaml

from server.config.camera_password import fill_in_password
from server.config.loader import load_config
from server.setup.camera_address import parse_address
from server.setup.session import TriedCamera, TriedStream
from server.setup.site_cameras import (
    add_camera,
    list_cameras,
    readdress_camera,
    remove_camera,
    rename_camera,
)
from server.setup.trial_messages import StreamTrial
from server.system.errors import UserError

SECRET = "p@ss: {word} #1"  # noqa: S105 — of a camera that does not exist
PLANS = {"c0": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "old": [[2, 0, 0], [0, 2, 0], [0, 0, 1]]}
TEXT = """\
# mine
ground: site.ground.json
cameras:
- {id: c0, source: 'scene:room', offset_s: 0.5}
- {id: c1, source: 'rtsp://viewer:hidden@10.0.0.1/hidden?p=hidden'}
# after
view: {switch_cost_s: 2.0}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "site.ground.json").write_text(json.dumps({"unit": "m", "homography": PLANS}))
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    path.chmod(0o640)
    return path


def tried(name: str = "", source: str = "rtsp://10.0.0.9/live") -> TriedCamera:
    return TriedCamera(1, name, TriedStream(parse_address(source, "viewer", SECRET), StreamTrial()))


def ids(path: Path) -> list[str]:
    return [camera.id for camera in list_cameras(path)]


def test_cameras_are_listed_without_secrets(path: Path) -> None:
    assert [camera.address for camera in list_cameras(path)] == ["scene:room", "rtsp://10.0.0.1/..."]


def test_an_added_camera_has_its_password_in_a_private_file(path: Path) -> None:
    add_camera(path, tried("door"))
    config = load_config(path)
    assert config.camera_ids == ("c0", "c1", "door")
    assert fill_in_password(config, "door").camera("door").source == tried().address.with_password
    assert "p@ss" not in path.read_text()
    secret = path.parent / "site.passwords" / "door"
    assert [stat.S_IMODE(file.stat().st_mode) for file in (secret, secret.parent, path)] == [
        0o600,
        0o700,
        0o640,
    ]


def test_the_earlier_file_is_kept_and_the_rest_of_the_text_stays(path: Path) -> None:
    add_camera(path, tried())
    (kept,) = path.parent.glob("site.2*.yaml")
    assert kept.read_text() == TEXT
    assert path.read_text().startswith("# mine\n")
    assert path.read_text().endswith(TEXT[TEXT.index("# after") :])
    assert load_config(path).camera("c0").offset_s == 0.5


@pytest.mark.parametrize("name", ["c0", "old", "gone"], ids=["camera", "homography", "password"])
def test_an_added_camera_takes_over_nothing_of_another_one(path: Path, name: str) -> None:
    add_camera(path, tried("gone"))
    remove_camera(path, "gone")
    add_camera(path, tried(name, "rtsp://10.0.0.8/live"))
    assert ids(path) == ["c0", "c1", f"{name}-1"]
    assert load_config(path).camera(f"{name}-1").ground is None


def test_a_camera_is_not_added_twice(path: Path) -> None:
    add_camera(path, tried())
    with pytest.raises(UserError, match="already"):
        add_camera(path, tried("other"))


def test_a_camera_gets_another_address_and_keeps_its_settings_and_the_comments(path: Path) -> None:
    text = TEXT.replace("cameras:\n", "cameras:\n# at the door\n").replace(
        "hidden'}", "hidden'}  # in the hall"
    )
    path.write_text(text)
    readdress_camera(path, "c0", tried())
    config = load_config(path)
    assert config.camera("c0").offset_s == 0.5
    assert config.camera("c0").ground is not None
    assert fill_in_password(config, "c0").camera("c0").source == tried().address.with_password
    assert path.read_text().startswith(text[: text.index("- {id: c0")])
    assert path.read_text().endswith(text[text.index("- {id: c1") :])
    before = path.read_text()
    readdress_camera(
        path,
        "c0",
        TriedCamera(
            1, "", TriedStream(parse_address("rtsp://10.0.0.9/live", "viewer", "n3w"), StreamTrial())
        ),
    )
    assert (path.parent / "site.passwords" / "c0").read_text() == f"{SECRET}\n"  # of the earlier file
    assert fill_in_password(load_config(path), "c0").camera("c0").source == "rtsp://viewer:n3w@10.0.0.9/live"
    (path.parent / "again.yaml").write_text(before)
    assert (
        load_config(path.parent / "again.yaml").camera("c0").password
        != load_config(path).camera("c0").password
    )
    with pytest.raises(UserError, match=r"rtsp://10.0.0.9/...: another camera of the configuration has this"):
        readdress_camera(path, "c1", tried())
    with pytest.raises(UserError, match="there is no camera 'c7'"):
        readdress_camera(path, "c7", tried())


COMMENTED = """\
cameras:
# at the door
- id: c0  # faces east
  # a cable of 80 m
  source: rtsp://10.0.0.1/live  # {beside}
  substream: rtsp://10.0.0.1/small  # people are tracked in it
  offset_s: 0.5  # measured
  options:  # of FFmpeg
    rtsp_transport: udp  # in vain
  # the plant
  passthrough: auto  # if it can
- {{id: c1, source: scene:room}}  # drawn
"""


@pytest.mark.parametrize("beside", ["H.264 64x48, 5 fps", "over the till, 4 m up"])
def test_comments_in_the_entry_of_a_camera_with_another_address_stay(path: Path, beside: str) -> None:
    """What set-up has written beside the address becomes what the camera sends now."""
    text = COMMENTED.format(beside=beside)
    path.write_text(text)
    trial = StreamTrial(codec="H.265", width=128, height=96)
    readdress_camera(path, "c0", TriedCamera(1, "", TriedStream(tried().address, trial)))
    entry = """\
- id: c0  # faces east
  # a cable of 80 m
  source: {source}  # {beside}
  offset_s: 0.5  # measured
  options:  # of FFmpeg
    {{rtsp_transport: tcp}}
  # the plant
  passthrough: auto  # if it can
  password: site.passwords/c0
"""
    now = "H.265 128x96" if "64x48" in beside else beside
    written = entry.format(source=tried().address.source, beside=now)
    first, last = text.index("- id: c0"), text.index("- {id: c1")
    assert path.read_text() == text[:first] + written + text[last:]


def test_a_substream_stays_with_its_address(path: Path) -> None:
    """Of another channel of the same recorder, other people would be tracked."""
    small = "rtsp://10.0.0.1/small"
    readdress_camera(path, "c1", tried())
    content = yaml.safe_load(path.read_text())
    content["cameras"][1]["substream"] = small
    path.write_text(yaml.safe_dump(content))
    readdress_camera(path, "c1", tried())
    assert load_config(path).camera("c1").substream == small
    readdress_camera(path, "c1", tried(source="rtsp://10.0.0.1/other"))
    assert load_config(path).camera("c1").substream is None


def test_a_renamed_camera_keeps_its_settings_calibration_and_password(path: Path) -> None:
    add_camera(path, tried("door"))
    before = load_config(path)
    rename_camera(path, "c0", "front")
    rename_camera(path, "door", "back")
    config = load_config(path)
    assert config.camera_ids == ("front", "c1", "back")
    assert config.camera("front") == before.camera("c0").model_copy(update={"id": "front"})
    assert config.camera("front").ground is not None
    assert fill_in_password(config, "back").camera("back").source == tried().address.with_password
    rename_camera(path, "front", "c0")
    assert load_config(path).camera("c0") == before.camera("c0")


def test_letters_of_any_language_stay_readable_in_a_changed_entry(path: Path) -> None:
    path.write_text(TEXT.replace("scene:room", "Straße/über.mp4"), encoding="utf-8")
    rename_camera(path, "c0", "front")
    assert "Straße/über.mp4" in path.read_text(encoding="utf-8")


def test_a_renamed_camera_does_not_get_the_calibration_of_an_earlier_one(path: Path) -> None:
    rename_camera(path, "c1", "old")
    assert load_config(path).camera("old").ground is None


def test_a_removed_camera_is_gone_but_for_the_last_one(path: Path) -> None:
    remove_camera(path, "c0")
    assert ids(path) == ["c1"]
    with pytest.raises(UserError, match="at least one camera"):
        remove_camera(path, "c1")


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("c1", "another camera"),
        ("", "a name has"),
        ("a/b", "a name has"),
        ("../c0", "a name has"),
        ("c0\n", "a name has"),
        ("bestview-2", "a camera is not called bestview-2"),
        ("x" * 33, "a name has"),
    ],
)
def test_an_invalid_name_changes_nothing(path: Path, name: str, error: str) -> None:
    with pytest.raises(UserError, match=error):
        rename_camera(path, "c0", name)
    assert unchanged(path)


def unchanged(path: Path) -> bool:
    others = {file.name for file in path.parent.iterdir()} - {"site.yaml", "site.ground.json"}
    ground = json.loads((path.parent / "site.ground.json").read_text())
    return path.read_text() == TEXT and not others and ground["homography"] == PLANS


def test_an_unknown_camera_is_an_error(path: Path) -> None:
    with pytest.raises(UserError, match="no camera 'c7'"):
        rename_camera(path, "c7", "front")
    with pytest.raises(UserError, match="no camera 'c7'"):
        remove_camera(path, "c7")
    assert unchanged(path)


@pytest.mark.parametrize(
    "setting",
    [
        "sound: {source: c0}",
        "zones: [{id: desk, camera: c0, area: [[0, 0], [9, 0], [9, 9]]}]",
    ],
)
def test_a_camera_that_another_setting_names_stays(path: Path, setting: str) -> None:
    path.write_text(f"{TEXT}{setting}\n")
    load_config(path)
    with pytest.raises(UserError, match="c0"):
        remove_camera(path, "c0")
    with pytest.raises(UserError, match="c0"):
        rename_camera(path, "c0", "front")
    assert ids(path) == ["c0", "c1"]


@pytest.mark.parametrize("text", ["", "[]", "cameras: {}", "cameras: [c0]", "cameras: [", "\0"])
def test_a_file_that_cannot_be_changed_is_one_line(path: Path, text: str) -> None:
    path.write_text(text)
    for change in (
        lambda: list_cameras(path),
        lambda: add_camera(path, tried()),
        lambda: rename_camera(path, "c0", "front"),
        lambda: remove_camera(path, "c0"),
    ):
        with pytest.raises(UserError) as refused:
            change()
        assert len(str(refused.value).splitlines()) == 1
    assert path.read_text() == text
    assert not (path.parent / "site.passwords").exists()


def test_an_invalid_configuration_or_ground_file_is_not_changed(path: Path) -> None:
    path.write_text(TEXT.replace("switch_cost_s", "swich_cost_s"))
    with pytest.raises(UserError, match="swich_cost_s"):
        remove_camera(path, "c0")
    path.write_text(TEXT)
    (path.parent / "site.ground.json").write_text("{}")
    for change in (lambda: add_camera(path, tried()), lambda: rename_camera(path, "c0", "front")):
        with pytest.raises(UserError, match="homography"):
            change()
    assert path.read_text() == TEXT
    assert not (path.parent / "site.passwords").exists()
