"""`myview calibrate TRACKS` writes a file that the configuration loads and a report, or leaves nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fakes.cli.command_line import RunCommand, input_error
from fakes.media.videos import write_video
from server.config.loader import build_config
from tracking.motchallenge import MotRow, write_rows

OFFSET = 6


@pytest.fixture
def run(myview: RunCommand, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> RunCommand:
    """Return a function that runs `myview calibrate` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: myview("calibrate", *arguments)


def camera(east: float, north: float) -> np.ndarray:
    """The (3, 4) projection of a camera 1.7 person heights high that looks at the middle of the floor."""
    centre = np.array([east, north, 1.7])
    forward = np.array([0.0, 0.0, 0.6]) - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 0, 1.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    lens = np.array([[500.0, 0, 320], [0, 500, 180], [0, 0, 1]])
    return np.asarray(lens @ np.column_stack([axes, -axes @ centre]))


def write_walk(folder: Path, frames: int, path_of: Callable[[np.ndarray], np.ndarray]) -> Path:
    """Write two cameras' tracks of a person; the second recording begins `OFFSET` frames later."""
    folder.mkdir()
    place = path_of(np.arange(frames))
    for name, where, offset in (("c0", (-4.0, -1.0), 0), ("c1", (1.0, -4.5), OFFSET)):
        rows = []
        for frame, (east, north) in enumerate(place):
            foot, head = (camera(*where) @ [east, north, up, 1.0] for up in (0.0, 1.0))
            (x, bottom), top = foot[:2] / foot[2], head[1] / head[2]
            tall = bottom - top
            if frame >= offset and x - tall / 5 > 0 and x + tall / 5 < 640 and bottom < 360:
                rows.append(MotRow(frame - offset + 1, 1, x - tall / 5, top, 0.4 * tall, tall))
        write_rows(folder / f"{name}.txt", rows)
    return folder


def curved(frames: np.ndarray) -> np.ndarray:
    return np.column_stack([1.6 * np.sin(frames / 47.0), 1.6 * np.sin(frames / 31.0 + 1)])


def test_tracks_become_a_ground_file_and_an_offset_to_copy(run: RunCommand, tmp_path: Path) -> None:
    write_walk(tmp_path / "tracks", 450, curved)
    code, out, err = run("tracks", "--size", "640x360", "--shift", "0.8", "--out", "ground.json")
    assert (code, err) == (0, "")
    assert "person heights (median; 90 % below" in out
    assert f"cameras:\n  - id: c1\n    offset_s: {OFFSET / 25:g}\n" in out
    assert (tmp_path / "ground.png").read_bytes().startswith(b"\x89PNG")
    cameras = [{"id": name, "source": "scene:room"} for name in ("c0", "c1")]
    config = build_config({"cameras": cameras, "ground": "ground.json"}, where="test", folder=tmp_path)
    assert all(camera.ground is not None for camera in config.cameras)
    content = json.loads((tmp_path / "ground.json").read_text())
    assert content["unit"] == "m"
    assert content["offset"]["c1"]["use"] == OFFSET / 25
    assert content["left_out"] == {}


def test_a_walk_in_one_place_is_refused_and_nothing_is_written(run: RunCommand, tmp_path: Path) -> None:
    write_walk(tmp_path / "tracks", 100, lambda frames: np.zeros((len(frames), 2)))
    code, out, err = run("tracks", "--size", "640x360", "--shift", "0", "--out", "ground.json")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert err.startswith("myview: calibrate: c0 and c1: no person was tracked by both cameras at the same")
    assert [path.name for path in tmp_path.iterdir()] == ["tracks"]


def test_a_walk_only_in_the_middle_is_written_only_with_force(run: RunCommand, tmp_path: Path) -> None:
    def near_the_middle(frames: np.ndarray) -> np.ndarray:
        return np.column_stack([0.7 * np.sin(frames / 23.0), 0.7 * np.sin(frames / 15.0 + 1)])

    write_walk(tmp_path / "tracks", 300, near_the_middle)
    arguments_of_command = ("tracks", "--size", "640x360", "--shift", "0", "--out", "ground.json")
    code, _, err = run(*arguments_of_command)
    assert code == 2
    assert "the walk covered too little: walk also" in err
    assert not (tmp_path / "ground.json").exists()
    code, out, _ = run(*arguments_of_command, "--force")
    assert code == 0
    assert "walk also" in out
    assert (tmp_path / "ground.json").exists()


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("away",), "away: does not exist"),
        (("a.txt", "a.txt"), "two cameras are called 'a'"),
        (("det.txt", "a.txt"), "det.txt: has detections, not tracks"),
        (("empty.txt", "a.txt"), "empty.txt: has no people"),
        (("a.txt",), "at least two cameras"),
        (("a.txt", "b.txt", "--size", "wide"), "--size: 'wide' is not WIDTHxHEIGHT"),
        (("p.csv", "a.txt"), "marked points are one file"),
        (("a.txt", "film.mp4"), "a.txt is tracks and film.mp4 is not"),
        (("a.txt", "b.txt", "--plan", "ground.json"), "the floor plan would be written there too"),
    ],
)
def test_invalid_walks_are_refused_with_one_line(
    run: RunCommand, tmp_path: Path, arguments: tuple[str, ...], error: str
) -> None:
    for name, text in (
        ("a.txt", "1,1,10,10,20,50,1,-1,-1,-1\n"),
        ("b.txt", "1,1,10,10,20,50,1,-1,-1,-1\n"),
        ("det.txt", "1,-1,10,10,20,50,1,-1,-1,-1\n"),
        ("empty.txt", ""),
        ("p.csv", ""),
        ("film.mp4", ""),
    ):
        (tmp_path / name).write_text(text)
    code, out, err = run(*arguments, "--out", "ground.json")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert error in err
    assert not (tmp_path / "ground.json").exists()


def test_videos_are_tracked_first_and_must_have_equal_rates(run: RunCommand, tmp_path: Path) -> None:
    write_video(tmp_path / "c0.mp4", 20)
    write_video(tmp_path / "c1.mp4", 20, fps=30)
    line = input_error(run("c0.mp4", "c1.mp4", "--out", "ground.json"))
    assert "c1 has 30 frames a second and c0 25" in line
    (tmp_path / "site.yaml").write_text(
        "ground: ground.json\n"  # which is to be made
        "detect: {prescan_s: 0}\n"  # so that twenty frames are too few to know the scene
    )
    result = run("c0.mp4", "c1.mp4", "--fps", "25", "--config", "site.yaml", "--out", "ground.json")
    assert (result.code, result.err) == (2, "tracking c0\nmyview: c0.mp4: has no people\n")
    assert {path.name for path in tmp_path.iterdir()} == {"c0.mp4", "c1.mp4", "site.yaml"}
