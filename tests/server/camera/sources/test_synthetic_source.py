"""The synthetic scene as a camera, and errors in its address."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

from server.camera.sources import Recording
from server.camera.sources.opening import open_video
from server.camera.sources.synthetic import SyntheticSource
from server.config.sections import SiteSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.supervisor.synthetic_homographies import add_synthetic_homographies
from server.system.errors import UserError
from synthetic import Scene

SITE = SiteSettings(width=128, height=72)


def test_the_address_selects_scene_and_camera() -> None:
    stage = SyntheticSource("scene:room?camera=1&cameras=2&objects=3&seed=5", SITE)
    scene = Scene("room", 2, 3, 5, 128, 72, 25.0)
    assert stage.size == (128, 72)
    np.testing.assert_array_equal(stage.take(30), scene.image(1, 30))


def test_defaults_are_the_demos() -> None:
    np.testing.assert_array_equal(
        SyntheticSource("scene:room", SITE).take(0), Scene("room", 3, 4, 1, 128, 72).image(0, 0)
    )


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("scene:cellar", "there is no scene 'cellar'"),
        ("scene:", "there is no scene ''"),
        ("scene:room?camera=3", "numbered from 0"),
        ("scene:room?camera=-1", "camera=-1 must be a whole number"),
        ("scene:room?camera=", "camera= must be a whole number"),
        ("scene:room?seed=one", "seed=one must be a whole number"),
        ("scene:room?seed=²", "must be a whole number"),
        (f"scene:room?seed={'9' * 5000}", "must be a whole number"),
        ("scene:room?people=3", "people=3 must be a whole number, for one of camera, cameras, objects, seed"),
        ("scene:room?cameras=1000", "cameras must be"),
        ("scene:room?cameras=0", "cameras must be"),
    ],
)
def test_a_wrong_address_is_refused_with_the_reason(source: str, reason: str) -> None:
    with pytest.raises(UserError) as caught:
        SyntheticSource(source, SITE)
    assert reason in str(caught.value)
    assert str(caught.value).startswith(source)


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("scene:room", SourceKind.SCENE),
        ("rtsp://camera/stream", SourceKind.STREAM),
        ("/dev/video0", SourceKind.STREAM),
        ("/dev/unplugged", SourceKind.STREAM),
        ("/dev/null", SourceKind.STREAM),
        ("/dev/shm/nowhere.mp4", SourceKind.FILE),  # noqa: S108
        ("/devices/a.mp4", SourceKind.FILE),
        ("/", SourceKind.FOLDER),
        ("a.mp4", SourceKind.FILE),
        (300 * "a" + ".mp4", SourceKind.FILE),  # no name that a file can have, which opening it says
    ],
)
def test_the_kind_of_a_source_follows_from_its_address(source: str, kind: SourceKind) -> None:
    assert source_kind(source) is kind


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="needs a folder in memory")  # noqa: S108
def test_a_recording_in_dev_shm_is_a_file() -> None:
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        recording = Path(folder) / "c0.mp4"
        recording.touch()
        assert source_kind(str(recording)) is SourceKind.FILE
        assert source_kind(folder) is SourceKind.FOLDER
        with pytest.raises(UserError, match="cannot open this video"):
            open_video(str(recording))


def test_an_impossible_file_name_is_refused_in_one_line() -> None:
    with pytest.raises(UserError, match="cannot open this video: File name too long"):
        Recording(300 * "a" + ".mp4", 0, "stop")


def test_cameras_of_a_scene_without_a_floor_have_no_homography() -> None:
    cameras = [
        {"id": f"c{number}", "source": f"scene:{name}"} for number, name in enumerate(("fish", "court"))
    ]
    site = Config.model_validate({"site": {"width": 128, "height": 72}, "cameras": cameras})
    tank, court = add_synthetic_homographies(site).cameras
    assert tank.ground is None
    assert court.ground is not None
    assert SyntheticSource("scene:fish?camera=1&cameras=2", SITE).take(3) is not None
