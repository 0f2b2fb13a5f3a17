"""The command line: exit code 0, or a one-line error and no incomplete files."""

from __future__ import annotations

import os
import resource
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from fakes.cli.command_line import RunCommand, input_error
from fakes.media.videos import write_video
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.config.loader import load_config
from server.system.errors import UnavailableError
from synthetic import Scene, scene_names


@pytest.fixture
def run(myview: RunCommand, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> RunCommand:
    """Return a function that runs `myview` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return myview


def file_names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def site(folder: Path, **changes: Any) -> Path:
    content = {
        # In this process, which is to stay as it is.
        "site": {"width": 64, "height": 48, "niceness": 0},
        "cameras": [{"id": "c0", "source": "c0.mp4"}],
        **{f: {"port": free_port()} for f in ("sync", "http")},
        "zenoh": dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{free_port()}"),
        **changes,
    }
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.fixture
def used_port() -> Iterator[int]:
    """Yield a port in use."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield int(server.getsockname()[1])


COMMANDS = ["sync", "bestview", "up"]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"htp": {"port": 1}}, "htp: unknown key; did you mean 'http'?"),
        ({"cameras": [{"id": "a", "source": "x"}] * 2}, "two cameras are called 'a'"),
        ({"cameras": [{"id": "a", "source": "x", "ground": [[0] * 3] * 3}]}, "not invertible"),
        ({"cameras": []}, "cameras"),
        ({"cameras": [{"id": "bestview-1", "source": "x"}]}, "is the name of a best-view service"),
        ({"zenoh": {"listen": "nonsense"}}, "zenoh.listen"),
        ({"sync": {"port": 70000}}, "sync.port"),
        ({"site": {"fps": float("inf")}}, "site.fps"),
    ],
)
def test_an_invalid_configuration_is_refused(
    run: RunCommand, tmp_path: Path, command: str, changes: dict[str, Any], reason: str
) -> None:
    assert reason in input_error(run(command, site(tmp_path, **changes)))


@pytest.mark.parametrize("command", [["sync"], ["camera"], ["bestview"], ["up"]])
def test_a_missing_configuration_is_refused(run: RunCommand, command: list[str]) -> None:
    arguments = [*command, "none.yaml", *(["c0"] if command == ["camera"] else [])]
    assert "none.yaml: cannot read the configuration: No such file" in input_error(run(*arguments))


def test_keys_that_are_no_text_and_invalid_sections_of_the_environment_are_refused(
    run: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "odd.yaml").write_text("1: 2\n")
    assert "mapping of sections" in input_error(run("sync", "odd.yaml"))
    monkeypatch.setenv("MYVIEW_CAMERAS", "no json")
    assert "environment" in input_error(run("sync", site(tmp_path)))


def test_an_unknown_section_is_refused_in_the_environment_too(
    run: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MYVIEW_GROUND__X", "1")
    assert "there is no section 'ground'" in input_error(run("sync", site(tmp_path)))


DETECTIONS = "".join(f"{n},-1,{n},10,20,40,0.9,-1,-1,-1\n" for n in range(1, 200))


@pytest.mark.parametrize(
    ("command_words", "reason"),
    [
        (["track", "--det", "det.txt", "--out", "det.txt"], "is an input, and would be replaced"),
        (["track", "--det", "det.txt", "--out", "sub/../det.txt"], "is an input, and would be replaced"),
        (["calibrate", "points.json", "--out", "points.json"], "is an input, and would be replaced"),
        (["calibrate", "points.json", "--out", "g.json", "--plan", "points.json"], "would be replaced"),
        (["calibrate", "points.json", "--out", "g.json", "--unit", "metres"], "did you mean 'm'?"),
        (["evaluate", "--gt", "det.txt", "--tracks", "det.txt", "--json", "det.txt"], "would be replaced"),
        (["track", "--det", "det.txt", "--out", "pipe"], "is not a regular file"),
        (["track", "det.txt", "--out", "t.txt"], "this is text, not video"),
        (["render", "det.txt", "--out", "r"], "this is text, not video"),
        (["track", "--det", "det.txt", "--out", "t" * 300], "File name too long"),
        (["watch", "http://127.0.0.1:1", "--out", "x.mp4"], "need --object"),
        (["watch", "http://127.0.0.1:1", "--object", "1", "--out", "sub"], "is a folder"),
    ],
    ids=lambda arguments: " ".join(arguments)[:40] if isinstance(arguments, list) else "",
)
def test_inputs_and_special_files_are_not_replaced_and_invalid_options_are_refused(
    run: RunCommand, tmp_path: Path, command_words: list[str], reason: str
) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "det.txt").write_text(DETECTIONS)
    (tmp_path / "points.json").write_text('{"cameras": {}}')
    os.mkfifo(tmp_path / "pipe")
    before = file_names(tmp_path)
    assert reason in input_error(run(*command_words))
    assert file_names(tmp_path) == before
    assert (tmp_path / "det.txt").read_text() == DETECTIONS


def test_a_full_disk_is_reported_in_one_line_and_leaves_nothing(run: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "det.txt").write_text(DETECTIONS)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, before[1]))
    try:
        line = input_error(run("track", "--det", "det.txt", "--out", "t.txt"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    assert "t.txt: cannot write there: File too large" in line
    assert file_names(tmp_path) == {"det.txt"}


def test_an_invalid_log_level_is_refused(
    run: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MYVIEW_LOG", "loud")
    assert "MYVIEW_LOG" in input_error(run("sync", site(tmp_path)))


def test_an_unknown_camera_is_refused_with_the_known_ones(run: RunCommand, tmp_path: Path) -> None:
    assert "there is no camera 'c9'; there are c0" in input_error(run("camera", site(tmp_path), "c9"))


@pytest.mark.parametrize("command", [["up"], ["camera", "c0"]])
@pytest.mark.parametrize("content", [None, b"", b"no video at all"])
def test_a_missing_or_broken_video_is_refused(
    run: RunCommand, tmp_path: Path, command: list[str], content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / "c0.mp4").write_bytes(content)
    line = input_error(run(command[0], site(tmp_path), *command[1:]))
    assert "camera c0: " in line
    assert "c0.mp4" in line


@pytest.mark.parametrize("section", ["http", "sync", "zenoh"])
def test_a_port_in_use_is_refused_and_nothing_is_written(
    run: RunCommand, tmp_path: Path, used_port: int, section: str
) -> None:
    write_video(tmp_path / "c0.mp4", 3)
    address = dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{used_port}")
    path = site(tmp_path, **{section: address if section == "zenoh" else {"port": used_port}})
    assert f"{section}." in input_error(run("up", path, "--out", "out"))
    if section != "sync":
        assert f"{section}." in input_error(run("bestview", path, "--out", "out"))
    else:
        assert "the port is in use" in input_error(run("sync", path))
    assert file_names(tmp_path) == {"c0.mp4", "site.yaml"}


def test_the_port_on_the_command_line_overrides_the_configuration(
    run: RunCommand, tmp_path: Path, used_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MYVIEW_HTTP__PORT", "1")  # so that the command's settings are undone
    assert f"127.0.0.1:{used_port}" in input_error(run("up", site(tmp_path), "--port", used_port))
    assert f"127.0.0.1:{used_port}" in input_error(run("demo", "--port", used_port, "--no-browser"))


@pytest.mark.parametrize("command", ["up", "bestview"])
def test_an_output_folder_that_is_not_empty_is_refused(run: RunCommand, tmp_path: Path, command: str) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    line = input_error(run(command, site(tmp_path), "--out", "out"))
    assert "out: exists and is not an empty folder" in line


def test_scene_lists_the_scenes_and_their_default_cameras(run: RunCommand, tmp_path: Path) -> None:
    shown = run("scene", "--help").out
    assert all(f"{name}:" in shown for name in scene_names())
    result = run("scene", "fish", "--out", "fish", "--seconds", 0.2, "--size", "128x72")
    assert (result.code, result.err) == (0, "")
    assert result.out.splitlines()[-1] == "fish: 1 view, gt/"
    assert file_names(tmp_path / "fish") == {"c0.mp4", "gt"}


def test_scene_writes_a_recording_or_refuses(run: RunCommand, tmp_path: Path) -> None:
    small = ["--cameras", 1, "--objects", 1, "--size", "128x72"]
    result = run("scene", "room", "--out", "room", "--seconds", 0.2, *small)
    assert (result.code, result.err) == (0, "")
    assert file_names(tmp_path / "room") == {"c0.mp4", "gt", "ground.json"}
    assert "not an empty folder" in input_error(run("scene", "room", "--out", "room", *small))
    assert "there is no scene 'cellar'" in input_error(run("scene", "cellar", "--out", "new", *small))
    assert "WIDTHxHEIGHT" in input_error(run("scene", "room", "--out", "new", "--size", "big"))
    assert "must be even" in input_error(run("scene", "room", "--out", "new", "--size", "129x72"))
    assert "cameras must be" in input_error(run("scene", "room", "--out", "new", "--cameras", 100))
    assert "cannot write there" in input_error(run("scene", "room", "--out", "room/c0.mp4/x", *small))
    assert "not an empty folder" in input_error(run("scene", "room", "--out", "room/c0.mp4", *small))
    assert "at least one frame" in input_error(
        run("scene", "room", "--out", "new", "--fps", 1, *small, "--seconds", 0.4)
    )
    assert file_names(tmp_path) == {"room"}


def test_an_interrupted_scene_leaves_no_incomplete_files(
    run: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[int] = []
    image = Scene.image

    def interrupted(scene: Scene, camera: int, frame: int) -> NDArray[np.uint8]:
        drawn.append(frame)
        if frame == 3:
            raise KeyboardInterrupt
        return image(scene, camera, frame)

    monkeypatch.setattr(Scene, "image", interrupted)
    result = run("scene", "room", "--out", "room", "--cameras", 1, "--objects", 1, "--size", "128x72")
    assert result.code == 130
    assert drawn == [0, 1, 2, 3]
    assert file_names(tmp_path) == set()


def test_track_writes_a_file_or_refuses(run: RunCommand, tmp_path: Path) -> None:
    rows = [f"{frame},-1,10,10,8,20,0.9,-1,-1,-1\n" for frame in range(1, 31)]
    (tmp_path / "det.txt").write_text("".join(rows))
    (tmp_path / "bad.txt").write_text("1,2,three\n")
    write_video(tmp_path / "my view (1).mp4", 12)
    before = file_names(tmp_path)
    assert "name a video, or its detections" in input_error(run("track", "--out", "t.txt"))
    assert "there is no solver 'oracle'" in input_error(
        run("track", "--det", "det.txt", "--out", "t.txt", "--solver", "oracle")
    )
    assert "no such file" in input_error(run("track", "none.mp4", "--out", "t.txt"))
    assert "No such file" in input_error(run("track", "--det", "none.txt", "--out", "t.txt"))
    assert "bad.txt" in input_error(run("track", "--det", "bad.txt", "--out", "t.txt"))
    assert "is a folder" in input_error(run("track", "--det", "det.txt", "--out", tmp_path))
    assert "cannot write there" in input_error(run("track", "--det", "det.txt", "--out", "det.txt/t.txt"))
    assert file_names(tmp_path) == before
    result = run("track", "--det", "det.txt", "--out", "t.txt")
    assert (result.code, result.out, result.err) == (0, "t.txt: 1 people\n", "")
    assert len((tmp_path / "t.txt").read_text().splitlines()) == 30
    assert run("track", "my view (1).mp4", "--out", "v.txt").code == 0


def test_track_reads_settings_from_a_configuration_in_any_folder(run: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "det.txt").write_text("1,-1,10,10,8,20,0.9,-1,-1,-1\n")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "ground.json").write_text('{"homography": {}}')
    path = site(tmp_path / "sub", ground="ground.json", track={"window": {"length_s": 0.4, "birth_s": 0.4}})
    assert run("track", "--det", "det.txt", "--out", "t.txt", "--config", path).code == 0
    path = site(tmp_path / "sub", track={"window": {"widow": 10}})
    assert "widow" in input_error(run("track", "--det", "det.txt", "--out", "t.txt", "--config", path))


@pytest.mark.parametrize("seconds", ["nan", "-1"])
@pytest.mark.parametrize("command", [["demo", "--no-browser"], ["watch", "http://127.0.0.1:1"]], ids=" ".join)
def test_invalid_seconds_are_refused(run: RunCommand, command: list[str], seconds: str) -> None:
    result = run(*command, "--seconds", seconds)
    assert result.code == 2
    assert "--seconds" in result.err


def test_watch_reports_an_unreachable_server_in_one_line(run: RunCommand) -> None:
    result = run("watch", f"http://127.0.0.1:{free_port()}")
    assert (result.code, result.out) == (UnavailableError.code, "")
    (line,) = result.err.splitlines()
    assert line.startswith("myview: watch: ")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["none.mp4"], "none.mp4: no such file or folder"),
        (["c0.mp4", "none.mp4"], "none.mp4: no such file or folder"),
        (["empty.mp4"], "empty.mp4: cannot open this video"),
        (["c0.mp4", "empty.mp4"], "empty.mp4"),
        (["c0.mp4", "sub/c0.mp4"], "two cameras are called 'c0'"),
        (["c0.mp4", "--det", "a.txt", "--det", "b.txt"], "--det: 2 detection files for 1 views"),
        (["--det", "a.txt", "--det", "b.txt", "--", "c0.mp4"], "--det: 2 detection files for 1 views"),
        (["c0.mp4", "--det", "a.txt"], "a.txt"),
        (["c0.mp4", "--ground", "none.json"], "none.json"),
        (["c0.mp4", "--config", "none.yaml"], "none.yaml: cannot read the configuration"),
        (["c0.mp4", "--config", "wrong.yaml"], "unknown key"),
        (["/dev/null"], "/dev/null: is not a recorded video"),
    ],
)
def test_render_refuses_and_leaves_nothing(
    run: RunCommand, tmp_path: Path, arguments: list[str], reason: str
) -> None:
    write_video(tmp_path / "c0.mp4", 5)
    (tmp_path / "sub").mkdir()
    write_video(tmp_path / "sub" / "c0.mp4", 5)
    (tmp_path / "empty.mp4").write_bytes(b"")
    (tmp_path / "wrong.yaml").write_text("sight: {}\n")
    before = file_names(tmp_path)
    assert reason in input_error(run("render", "--out", "out", *arguments))
    assert file_names(tmp_path) == before


def test_help_lists_every_command(run: RunCommand) -> None:
    result = run("--help")
    assert result.code == 0
    for command in ("demo", "up", "sync", "camera", "bestview", "render", "track", "scene", "watch"):
        assert command in result.out


def test_the_version_is_printed(run: RunCommand) -> None:
    result = run("--version")
    assert result.code == 0
    assert result.out == f"myview {version('myview')}\n"


def test_help_does_not_import_modules_of_commands() -> None:
    look = "import sys, server.cli.main; print(*{'numpy', 'scipy', 'cv2', 'pydantic'} & set(sys.modules))"
    command = [sys.executable, "-c", look]
    loaded = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert loaded.stdout.split() == []


def test_areas_proposes_a_setting_that_the_site_accepts(run: RunCommand, tmp_path: Path) -> None:
    cameras = [{"id": f"c{k}", "source": f"scene:room?camera={k}&cameras=3&objects=2"} for k in range(3)]
    result = run("areas", site(tmp_path, cameras=cameras), "--of", 2)
    assert result.code == 0, result.err
    proposed = yaml.safe_load(result.out)
    assert [area["margin"] for area in proposed["view"]["sharding"]["areas"]] == [5.0, 5.0]
    config = load_config(site(tmp_path, cameras=cameras, **proposed))
    assert sorted({camera for area in config.view.sharding.areas for camera in area.cameras}) == [
        "c0",
        "c1",
        "c2",
    ]
    few = run("areas", site(tmp_path, cameras=cameras), "--of", 4)
    assert "4 areas need as many calibrated cameras at least, but there are 3" in input_error(few)
