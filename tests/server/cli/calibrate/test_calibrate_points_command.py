"""`myview calibrate POINTS` writes a file that the configuration loads, or prints a one-line error."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bestview import to_ground
from fakes.cli.command_line import RunCommand
from server.config.loader import build_config

FLOOR = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [2.0, 1.0], [1.0, 2.0], [3.0, 2.5]])
TO_IMAGE = np.array([[90.0, 30.0, 120.0], [-6.0, 20.0, 330.0], [-0.01, 0.12, 1.0]])


@pytest.fixture
def run(myview: RunCommand, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> RunCommand:
    """Return a function that runs `myview calibrate` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: myview("calibrate", *arguments)


def pairs() -> list[dict[str, list[float]]]:
    through = np.column_stack([FLOOR, np.ones(len(FLOOR))]) @ TO_IMAGE.T
    image = through[:, :2] / through[:, 2:]
    return [{"image": a.tolist(), "floor": b.tolist()} for a, b in zip(image, FLOOR, strict=True)]


def write_json(path: Path, cameras: dict[str, list[dict[str, list[float]]]]) -> Path:
    path.write_text(json.dumps({"unit": "m", "cameras": cameras}), encoding="utf-8")
    return path


def test_json_points_become_a_ground_file_that_a_configuration_loads(run: RunCommand, tmp_path: Path) -> None:
    points = write_json(tmp_path / "points.json", {"c0": pairs(), "c1": pairs()[:4]})
    code, out, err = run(points, "--out", "ground.json")
    assert (code, err) == (0, "")
    assert "c0: 7 pairs" in out
    assert "c1: 4 pairs always fit exactly" in out
    assert (tmp_path / "ground.png").read_bytes().startswith(b"\x89PNG")
    cameras = [{"id": "c0", "source": "scene:room"}, {"id": "c1", "source": "scene:room"}]
    config = build_config({"cameras": cameras, "ground": "ground.json"}, where="test", folder=tmp_path)
    for camera in config.cameras:
        image = np.array([pair["image"] for pair in pairs()])
        assert np.allclose(to_ground(np.array(camera.ground), image), FLOOR, atol=1e-3)


def test_csv_and_json_points_give_the_same_result(run: RunCommand, tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"c0": pairs()})
    lines = [",".join(map(repr, ["c0", *pair["image"], *pair["floor"]])).replace("'", "") for pair in pairs()]
    (tmp_path / "b.csv").write_text("\n".join(["camera,image_x,image_y,floor_x,floor_y", *lines]) + "\n")
    assert run("a.json", "--out", "a.ground.json")[0] == 0
    assert run("b.csv", "--unit", "m", "--out", "b.ground.json")[0] == 0
    assert (tmp_path / "a.ground.json").read_bytes() == (tmp_path / "b.ground.json").read_bytes()
    (tmp_path / "c.csv").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "b.csv").read_bytes())
    assert run("c.csv", "--unit", "m", "--out", "c.ground.json").code == 0


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("p.json", "[1]", 'p.json: has no {"cameras"'),
        ("p.json", "{", "p.json:1: is not JSON"),
        ("p.json", '{"cameras": {}}', "p.json: has no pairs"),
        ("p.json", "[" * 100_000, "p.json: is not readable JSON"),
        ("p.json", '{"cameras": {"c0": [{"image": [1, 2]}]}}', "p.json: camera c0: pair 1: is not {"),
        ("p.json", '{"cameras": {"c0": [{"image": [1, 2], "floor": [1, "x"]}]}}', "are not four numbers"),
        ("p.csv", "a,b\n1,2\n", "p.csv:1: has no column 'camera'"),
        ("p.csv", "camera,image_x,image_y,floor_x,floor_y\nc0,1,2,3,inf\n", "p.csv:2: 1, 2, 3, inf: are not"),
        ("p.csv", "camera,image_x,image_y,floor_x,floor_y\nc0,1,2,3,4\n", "camera c0: 1 pair; at least 4"),
    ],
)
def test_an_invalid_points_file_is_refused_with_one_line(
    run: RunCommand, tmp_path: Path, name: str, text: str, error: str
) -> None:
    (tmp_path / name).write_text(text)
    code, out, err = run(name, "--out", "ground.json")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert error in err
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]


def test_an_inconsistent_pair_is_named_and_nothing_is_written(run: RunCommand, tmp_path: Path) -> None:
    wrong = pairs()
    wrong[4]["image"][0] += 120.0
    write_json(tmp_path / "points.json", {"c0": wrong})
    code, _, err = run("points.json", "--out", "ground.json")
    assert code == 2
    assert err.startswith("myview: points.json: camera c0: pair 5 (image")
    assert not (tmp_path / "ground.json").exists()
    assert not (tmp_path / "ground.png").exists()
