"""Settings that wait for others at a reload, and files that are repaired."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import yaml

from fakes.service.scripted_cameras import small_config
from server.config.running_config import (
    ACTIVE_CONFIG_VARIABLE,
    ActiveConfig,
    serialize_with_absolute_paths,
)
from server.supervisor.reload import plan_reload


def test_passthrough_waits_for_a_pending_codec_change() -> None:
    passing = [{"id": "c0", "source": "scene:room", "passthrough": "pass"}, "c1"]
    running = small_config(encode={"codec": "vp8"})
    reload = plan_reload(running, small_config(passing))
    assert (reload.cameras, reload.now) == ((), running)
    assert reload.site == ("encode.codec", "cameras.c0.passthrough")
    reload = plan_reload(small_config(), small_config(passing))
    assert (reload.cameras, reload.site) == (("c0",), ())


def test_an_invalid_ground_file_is_reported_until_it_is_repaired(
    tmp_path: Path,
) -> None:
    path, ground = tmp_path / "site.yaml", tmp_path / "ground.json"
    path.write_text(yaml.safe_dump({"cameras": [{"id": "c0", "source": "x"}], "ground": "ground.json"}))
    right = '{"homography": {"c0": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}'
    ground.write_text(right)
    running = ActiveConfig(path)
    ground.write_text('{"homography": {"c0": [[1]]}}')
    assert all("ground.json" in running.on_disk().error for _ in range(3))
    ground.write_text(right)
    assert not running.on_disk().differs


def test_an_active_configuration_of_another_user_is_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, new_file, link = (tmp_path / name for name in ("site.yaml", "theirs.yaml", "link.yaml"))
    path.write_text("cameras: [{id: c0, source: x}]\n")
    new_file.write_text("cameras: [{id: c9, source: x}]\n")
    link.symlink_to(new_file)
    monkeypatch.setenv(ACTIVE_CONFIG_VARIABLE, str(link))
    assert ActiveConfig(path).now.camera_ids == ("c0",)
    monkeypatch.setenv(ACTIVE_CONFIG_VARIABLE, str(new_file))
    assert ActiveConfig(path).now.camera_ids == ("c9",), "of the supervisor"
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert ActiveConfig(path).now.camera_ids == ("c0",)


def test_a_file_that_is_named_from_its_own_folder_differs_from_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`myview up` in the folder of site.yaml, as set-up starts it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret").write_text("word\n")
    path = Path("site.yaml")
    path.write_text("cameras: [{id: c0, source: 'rtsp://u:{password}@10.0.0.1/', password: secret}]\n")
    supervisor = ActiveConfig(path)
    active = tmp_path / "active.yaml"
    active.write_text(serialize_with_absolute_paths(supervisor.now, path.parent))
    assert not supervisor.on_disk().differs
    monkeypatch.setenv(ACTIVE_CONFIG_VARIABLE, str(active))
    assert ActiveConfig(path).on_disk().changed_keys == ()
