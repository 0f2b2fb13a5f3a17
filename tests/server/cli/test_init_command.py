"""`myview init` sets a site up in a terminal: found and entered cameras, tried, named and written."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from fakes.media.rtsp_camera import RtspCamera
from fakes.service.scripted_cameras import encoded
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from fakes.timeouts import PATIENCE
from server.config.loader import load_config

LOGIN = ("viewer", "s3cret")


def init(
    folder: Path, answers: Sequence[str], *options: str, targets: str = ""
) -> subprocess.CompletedProcess[str]:
    """Run the command with answers on standard input; it has no terminal."""
    return subprocess.run(
        [sys.executable, "-m", "server.cli.main", "init", str(folder / "site.yaml"), *options],
        input="".join(f"{answer}\n" for answer in answers),
        env={**os.environ, "MYVIEW_DISCOVERY": targets},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        start_new_session=True,
    )


def test_a_site_is_set_up_from_a_found_camera_and_an_address(tmp_path: Path) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    units = encoded(0, 40)
    gops = [units[at : at + 5] for at in range(0, 40, 5)]
    stream, small, other = (RtspCamera(gops, 12.5, login=LOGIN, live=True) for _ in range(3))
    profiles = [FakeProfile("main", stream.url, 1920, 1080, 12), FakeProfile("sub", small.url, 640, 360, 12)]
    camera = OnvifCamera("door", profiles, LOGIN)
    login, as_before = ["viewer", "s3cret"], ["", ""]
    answers = [
        *("y", "viewer", "wrong", "y", *login),  # a wrong password first
        *("", "", ""),  # the proposed streams; the camera's own name
        "not an address",
        *(other.url, *as_before, "bad name", "hall"),
        *("", "", "", "", ""),  # no more cameras; the proposals
    ]
    try:
        with onvif_cameras(camera) as targets:
            ended = init(tmp_path, answers, "--search", "1", targets=targets)
    finally:
        stream.close()
        small.close()
        other.close()
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "it refuses this user and password" in ended.stdout
    assert "enter an address such as" in ended.stdout
    assert "It sends h264 64x48, 12.5 fps; people are tracked in h264 64x48, 12.5 fps." in ended.stdout
    assert "It sends h264 64x48, 12.5 fps." in ended.stdout
    assert "s3cret" not in ended.stdout + ended.stderr
    config = load_config(tmp_path / "site.yaml")
    door, hall = config.cameras
    assert (door.source, door.substream) != (None, None)
    assert small.url.rpartition("@")[2].removeprefix("rtsp://") in (door.substream or "")
    assert hall.substream is None
    assert (config.camera_ids, config.site.size, config.site.fps) == (("door", "hall"), (64, 48), 12.5)


@pytest.mark.parametrize("answers", [[], [""]])
def test_a_dialog_without_a_camera_writes_nothing(tmp_path: Path, answers: Sequence[str]) -> None:
    ended = init(tmp_path, answers, "--search", "0")
    assert ended.returncode == 2
    assert "nothing was written" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert not list(tmp_path.iterdir())
