"""`myview render` as a process: it writes everything or nothing."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from fakes.media.audio import FLASH_INTERVAL, beeps, write_flashes
from fakes.media.videos import damage, write_video
from fakes.paths import ROOT
from fakes.timeouts import PATIENCE
from server.cli.generated_config import camera_name, config_for_videos, free_port
from synthetic import Scene, write_recording

MYVIEW = [sys.executable, "-m", "server.cli.main"]


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two views of a room; the second ends fifteen frames earlier."""
    folder = tmp_path_factory.mktemp("views")
    for name, frames in (("long", 80), ("short", 65)):
        write_recording(Scene("room", 2, 4, 4, 192, 108, 25.0), folder / name, frames / 25)
    return folder


def render(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [*MYVIEW, "render", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False, cwd=ROOT)


def test_two_views_become_films_tracks_choices_and_plots_with_one_warning_of_lengths(
    views: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    completed = render(views / "long" / "c0.mp4", views / "short" / "c1.mp4", "--out", out)
    assert completed.returncode == 0, completed.stderr
    assert completed.stderr.splitlines() == [
        "the views are of different length: c0 with frame 80, c1 with frame 65; the shorter ones end first"
    ]
    assert completed.stdout.startswith(f"{out}: best views of ")
    files = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    films = {name for name in files if name.startswith("best/object-")}
    assert films
    assert files - films == {
        "choices.csv",
        "choices-live.csv",
        "choices-smooth.csv",
        "choices.png",
        "corrections.csv",
        "events.csv",
        "late.csv",
        "site.json",
        "tracks/c0.txt",
        "tracks/c0.png",
        "tracks/c1.txt",
        "tracks/c1.png",
    }
    assert (out / "late.csv").read_text() == "frame,camera,reason\n"
    with (out / "choices.csv").open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    with (out / "corrections.csv").open(encoding="ascii", newline="") as file:
        corrected = {
            row["other"] if row["correction"] == "merged" else row["object"] for row in csv.DictReader(file)
        }
    numbers = {row["object"] for row in rows}
    assert {f"best/object-{number}.mp4" for number in numbers - corrected} <= films
    assert films <= {f"best/object-{number}.mp4" for number in numbers}
    assert all(row["camera"] == "c0" for row in rows if int(row["frame"]) > 65), "only c0 is left"
    for film in films:
        with av.open(str(out / film), "r") as container:
            pictures = list(container.decode(video=0))
        assert pictures[0].time == 0
        assert 0 < len(pictures) <= 80
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.slow
def test_every_film_has_the_configured_sound(views: Path, tmp_path: Path) -> None:
    write_flashes(tmp_path / "beeps.wav", 80, codec="pcm_s16le", pictures=False)
    (tmp_path / "site.yaml").write_text("sound: {source: beeps.wav}", encoding="utf-8")
    out = tmp_path / "out"
    completed = render(views / "long" / "c0.mp4", "--config", tmp_path / "site.yaml", "--out", out)
    assert completed.returncode == 0, completed.stderr
    with (out / "choices.csv").open(encoding="ascii", newline="") as file:
        rows = [(int(row["object"]), int(row["frame"]) - 1) for row in csv.DictReader(file)]
    for number in {number for number, _ in rows}:
        frames = [frame for row_number, frame in rows if row_number == number]
        data = (out / "best" / f"object-{number}.mp4").read_bytes()
        expected = [
            at - frames[0]
            for at in range(FLASH_INTERVAL, 80, FLASH_INTERVAL)
            if frames[0] <= at <= frames[-1]
        ]
        assert [25 * at for at in beeps(data)] == pytest.approx(expected, abs=1)


def test_an_error_while_rendering_leaves_nothing(tmp_path: Path) -> None:
    write_video(tmp_path / "c0.mp4", 25)
    damage(write_video(tmp_path / "c1.mp4", 5), [0, 1, 2, 3, 4])
    before = sorted(tmp_path.iterdir())
    completed = render(tmp_path / "c0.mp4", tmp_path / "c1.mp4", "--out", tmp_path / "out")
    assert completed.returncode == 2
    [line] = completed.stderr.splitlines()
    assert line.startswith(f"myview: camera c1: {tmp_path / 'c1.mp4'}: this video has no frames")
    assert sorted(tmp_path.iterdir()) == before


@contextmanager
def started_rendering(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a long rendering; return once it has begun to write."""
    (folder / "many").mkdir()
    cv2.imwrite(str(folder / "one.jpg"), np.zeros((90, 160, 3), np.uint8))
    for number in range(2000):
        os.link(folder / "one.jpg", folder / "many" / f"{number:04}.jpg")
    command = [*MYVIEW, "render", str(folder / "many"), "--out", str(folder / "out")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        end = time.monotonic() + PATIENCE
        while not list(folder.glob(".out-*/tracks/many.txt")):
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.02)
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_an_interrupted_rendering_leaves_nothing(tmp_path: Path, number: signal.Signals, code: int) -> None:
    with started_rendering(tmp_path) as process:
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == code
    assert err == ""
    assert not list(tmp_path.glob("*out*"))


def test_a_view_is_named_after_its_file_with_valid_characters() -> None:
    names = ["c0.mp4", "my view (1).mp4", "ä.mp4", "-x.mp4", f"{'long' * 20}.mp4", "a/b/hall-2.avi"]
    assert [camera_name(Path(name)) for name in names] == [
        "c0",
        "my-view-1-",
        "view",
        "x",
        "long" * 8,
        "hall-2",
    ]


def test_a_recording_is_played_once_regardless_of_the_configuration(tmp_path: Path) -> None:
    path = write_video(tmp_path / "c0.mp4", 3)
    base = {"cameras": [{"id": "c0", "source": "elsewhere", "at_end": "loop", "offset_s": 0.28}]}
    [camera] = config_for_videos([path], base=base).cameras
    assert (camera.at_end, camera.offset_s, camera.source) == ("stop", 0.28, str(path))


def test_a_recording_has_no_login_and_no_live_substream(tmp_path: Path) -> None:
    path = write_video(tmp_path / "c0.mp4", 3)
    login = {"source": "rtsp://u:{password}@10.0.0.1/1", "password": "file"}
    live, recorded = (
        config_for_videos([path], base={"cameras": [{"id": "c0", "substream": small, **login}]}).cameras[0]
        for small in ("rtsp://u:{password}@10.0.0.1/2", str(tmp_path / "small.mp4"))
    )
    assert (live.source, live.password, live.substream) == (str(path), None, None)
    assert recorded.substream == str(tmp_path / "small.mp4")


def test_rate_and_size_are_those_of_the_first_view_unless_configured(tmp_path: Path) -> None:
    path = write_video(tmp_path / "c0.mp4", 3)
    site = config_for_videos([path]).site
    assert (site.fps, site.width, site.height) == (25.0, 64, 48)
    assert config_for_videos([path], base={"site": {"fps": 10}}).site.fps == 10


def test_another_free_port_replaces_a_preferred_one_in_use() -> None:
    first = free_port()
    assert free_port(first) == first
    assert free_port(1) != 0
