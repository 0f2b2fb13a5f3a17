"""What set-up writes about a camera's streams stays true, and stays with its camera, when cameras change."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from server.config.loader import load_config
from server.setup.camera_address import parse_address
from server.setup.own_video import compare_own_video
from server.setup.proposal import SiteProposal
from server.setup.session import TriedCamera, TriedStream
from server.setup.site_cameras import add_camera, readdress_camera, remove_camera
from server.setup.site_file import NewSite, write_site
from server.setup.site_settings import StreamFormatChoice, save_choice
from server.setup.trial_messages import StreamTrial

FORMAT = SiteProposal(25.0, 1280, 720)
FITS = StreamTrial(width=1280, height=720, fps=25.0, codec="h264", gop=10)
SLOW = StreamTrial(width=1280, height=720, fps=12.5, codec="h264", gop=10)
LARGE = StreamTrial(width=1920, height=1080, fps=25.0, codec="hevc", gop=50)
DRAWN = StreamTrial(width=1280, height=720, fps=25.0, codec="mjpeg")
MINE = "    # mine: passthrough: auto  # its own video is blue\n"


def camera(name: str, trial: StreamTrial, substream: StreamTrial | None = None) -> TriedCamera:
    small = None
    if substream is not None:
        small = TriedStream(parse_address(f"rtsp://10.0.0.1/{name}-small"), substream)
    return TriedCamera(1, name, TriedStream(parse_address(f"rtsp://10.0.0.1/{name}"), trial), small)


def write(path: Path, *cameras: TriedCamera) -> str:
    new = [each.as_new(each.name, compare_own_video(each.trial, FORMAT)) for each in cameras]
    write_site(NewSite("hall", FORMAT, new), path)
    return path.read_text()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "site.yaml"


@pytest.mark.parametrize(
    ("before", "after", "comments"),
    [
        (SLOW, LARGE, ["#passthrough: auto", "# H.264; 1280x720 pixels; a", "# hevc 1920x1080, 25 fps"]),
        (LARGE, SLOW, ["#passthrough: auto", "    # 25 frames a second\n", "# h264 1280x720, 12.5 fps"]),
        (SLOW, FITS, ["    #passthrough: auto  # with encode.parameters: own, its own video is sent on"]),
        (SLOW, DRAWN, ["# mjpeg 1280x720, 25 fps"]),
        (FITS, FITS, ["    passthrough: auto  # its own video fits"]),
        (FITS, SLOW, ["    passthrough: auto  # sends its own video on,", "    # 25 frames a second\n"]),
        (FITS, DRAWN, ["    passthrough: auto\n"]),
    ],
)
def test_the_comments_of_a_camera_with_another_address_are_those_of_its_stream(
    path: Path, before: StreamTrial, after: StreamTrial, comments: list[str]
) -> None:
    text = write(path, camera("door", before), camera("yard", SLOW))
    path.write_text(text.replace("  - id: yard", f"{MINE}  # theirs\n  - id: yard"))
    has_set = load_config(path).camera("door").passthrough == "auto"
    for trial in (LARGE, after, before, after):  # what it has made is changed again
        readdress_camera(path, "door", camera(f"door-{trial.codec}-{trial.fps:g}", trial))
    door, yard = path.read_text().split("  - id: door\n")[1].split("  # theirs\n  - id: yard\n")
    assert [comment for comment in comments if comment not in door] == []
    assert door.count("passthrough: auto") == ("passthrough" in "".join(comments)) + 1
    assert door.endswith(MINE)
    assert yard == text.split("  - id: yard\n")[1]
    assert (load_config(path).camera("door").passthrough == "auto") is has_set


def test_the_comments_of_all_cameras_follow_the_format_of_the_site(path: Path) -> None:
    before = write(path, camera("door", FITS), camera("yard", SLOW))
    save_choice(path, StreamFormatChoice("yard", 25.0, 1280, 720))
    assert path.read_text().splitlines()[10:] == before.splitlines()[10:], "it has another name only"
    save_choice(path, StreamFormatChoice("yard", 12.5, 640, 360))
    door, yard = path.read_text().split("cameras:\n")[1].split("  - id: yard\n")
    settings = "H.264; 640x360 pixels; 12.5 frames a second; a fixed GOP (I-frame interval) of 5 frames"
    told = "passthrough: auto  # sends its own video on, which spares the encoding, once the camera"
    assert f"    {told} is set to:\n    # {settings}; no B frames\n" in door
    assert f"    #{told} is set to:\n    # {settings}; no B frames\n" in yard
    assert "fits" not in door


def test_the_comment_of_a_substream_is_that_of_another_one(path: Path) -> None:
    write(path, camera("door", SLOW, StreamTrial(width=640, height=360, fps=12.5, codec="h264")))
    other = StreamTrial(width=352, height=288, fps=6.0, codec="hevc")
    readdress_camera(path, "door", camera("gate", SLOW, other))
    (line,) = (line for line in path.read_text().splitlines() if "substream:" in line)
    assert line == (
        "    substream: rtsp://10.0.0.1/gate-small  # people are tracked in it, hevc 352x288, 6 fps"
    )


def test_the_comments_of_a_camera_stay_with_it_when_others_are_added_and_removed(path: Path) -> None:
    text = write(path, camera("door", SLOW), camera("yard", LARGE))
    door, yard = (f"  - id: {each}" for each in text.split("  - id: ")[1:])
    yard, rest = yard.split("\n\n")
    add_camera(path, camera("gate", SLOW))
    added = path.read_text()
    gate = added[added.index(yard) + len(yard) + 1 :].removesuffix(f"\n\n{rest}")
    assert added == f"{text[: text.index(door)]}{door}{yard}\n{gate}\n\n{rest}"
    assert yaml.safe_load(gate)[0]["id"] == "gate"
    remove_camera(path, "yard")
    assert path.read_text() == added.replace(f"{yard}\n", "")
    remove_camera(path, "gate")
    assert path.read_text() == text.replace(f"{yard}\n", "")
    add_camera(path, camera("yard", LARGE))
    remove_camera(path, "door")
    assert "passthrough" not in path.read_text(), "it was the door's"
