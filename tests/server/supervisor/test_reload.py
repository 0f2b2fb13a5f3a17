"""Reloading the configuration: the effect of each change, and invalid files."""

from __future__ import annotations

import asyncio
import os
import pty
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.scripted_cameras import CAMERAS, FedService, small_config
from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.config.config_diff import changed_keys
from server.config.loader import build_config
from server.config.running_config import (
    ACTIVE_CONFIG_VARIABLE,
    ActiveConfig,
    ConfigFileState,
    serialize_with_absolute_paths,
)
from server.config.sections import HttpSettings
from server.config.site_config import Config
from server.http.app import make_app, serving
from server.service.service import BestViewService
from server.supervisor.reload import plan_reload
from server.system.errors import UserError

LIVE, CAMERA, ALL_CAMERAS, BEST_VIEW, SITE = "live", "camera c1", "all cameras", "best view", "site"
GATEWAY = "RTSP gateway"

CHANGES: dict[str, tuple[str, Any]] = {
    "view.switch_cost_s": (LIVE, 2.0),
    "view.quality.centering": (LIVE, 0.5),
    "view.lookahead_s": (LIVE, 0.8),
    "view.buffer_s": (BEST_VIEW, 20.0),
    "view.live_lag_s": (BEST_VIEW, 0.4),
    "view.live_horizon_s": (BEST_VIEW, 2.0),
    "view.smooth_lookahead_s": (BEST_VIEW, 4.0),
    "view.identity.merge_threshold": (BEST_VIEW, 1.0),
    "http.port": (BEST_VIEW, 8123),
    "record.keep_s": (BEST_VIEW, 5.0),
    "access.blur": (BEST_VIEW, "others"),
    "sites.of": (BEST_VIEW, 3),
    "sites.share_looks": (BEST_VIEW, False),
    "rtsp.port": (GATEWAY, 8600),
    "rtsp.udp": (GATEWAY, False),
    "rtsp.enabled": (SITE, True),
    "cameras.c1.source": (CAMERA, "elsewhere.mp4"),
    "cameras.c1.substream": (CAMERA, "elsewhere-small.mp4"),
    "cameras.c1.offset_s": (CAMERA, 0.12),
    "cameras.c1.passthrough": (CAMERA, "auto"),
    "cameras.c1.options": (CAMERA, {"rtsp_transport": "tcp"}),
    "cameras.c1.ground": (SITE, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    "detect.box_filter.min_height": (ALL_CAMERAS, 0.3),
    "track.costs.occlusion": (ALL_CAMERAS, 0.9),
    "track.window.birth_max_cost": (ALL_CAMERAS, 0.6),
    "track.backlog_s": (SITE, 3.0),
    "track.joint": (SITE, False),
    "zones": (LIVE, [{"id": "hall", "area": [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]}]),
    "webhooks": (LIVE, [{"url": "https://example.org/hook"}]),
    "mqtt.host": (LIVE, "broker"),
    "rules": (LIVE, [{"id": "busy", "kind": "crowded", "more_than": 3}]),
    "site.time_zone": (LIVE, "Europe/Zurich"),
    "site.fps": (SITE, 12.5),
    "encode.crf": (SITE, 30),
    "zenoh.lease_s": (SITE, 2.0),
    "sync.port": (SITE, 7412),
}
"""Settings, the restart that a change needs, and another value."""


def changed_config(keys: set[str]) -> Config:
    content: dict[str, Any] = {}
    cameras: dict[str, dict[str, Any]] = {
        camera: {"id": camera, "source": "scene:room"} for camera in CAMERAS
    }
    small = {
        "view": {"identity": {"confirmation_s": 0.04, "clustering_interval_s": 0.04}},
        "track": {"window": WINDOW},
    }
    for key in keys:
        if "." not in key:
            content[key] = CHANGES[key][1]
            continue
        first, *path, name = key.split(".")
        inner = cameras[path.pop(0)] if first == "cameras" else content.setdefault(first, {})
        for step in path:
            inner = inner.setdefault(step, dict(small.get(first, {}).get(step, {})))
        inner[name] = CHANGES[key][1]
    return small_config([*cameras.values()], **content)


WINDOW = {"length_s": 0.2, "stride_s": 0.2, "birth_s": 0.2, "min_frames": 3}


@settings(max_examples=20)
@given(st.sets(st.sampled_from(sorted(CHANGES))))
def test_every_change_is_applied_or_named_as_pending(keys: set[str]) -> None:
    running, wanted = small_config(), changed_config(keys)
    reload = plan_reload(running, wanted)
    effects = {key: CHANGES[key][0] for key in keys}
    assert set(reload.live) == {key for key in keys if effects[key] == LIVE}
    assert set(reload.best_view) == {key for key in keys if effects[key] == BEST_VIEW}
    assert set(reload.gateway) == {key for key in keys if effects[key] == GATEWAY}
    assert set(reload.site) == {key for key in keys if effects[key] == SITE}
    if ALL_CAMERAS in effects.values():
        assert reload.cameras == CAMERAS
    else:
        assert reload.cameras == (("c1",) if CAMERA in effects.values() else ())
    assert set(changed_keys(reload.now, wanted)) == {*reload.best_view, *reload.site}
    repeated = plan_reload(reload.now, wanted)
    assert (repeated.now, repeated.live, repeated.cameras) == (reload.now, (), ())
    assert all(
        name in reload.line
        for name in {*reload.live, *reload.cameras, *reload.gateway, *reload.best_view, *reload.site}
    )
    assert (
        build_config(
            yaml.safe_load(serialize_with_absolute_paths(reload.now, Path())), where="", folder=Path("/")
        )
        == reload.now
    )


def test_a_lookahead_below_the_current_lag_waits_for_a_restart() -> None:
    track = {"window": {"length_s": 0.6, "stride_s": 0.2, "birth_s": 0.2, "min_frames": 3}}
    running = small_config(track=track, view={"lookahead_s": 0.6})
    reload = plan_reload(running, small_config(view={"lookahead_s": 0.2, "switch_cost_s": 1.0}))
    assert reload.live == ("view.switch_cost_s",)
    assert reload.best_view == ("view.lookahead_s",)
    assert reload.site == ("track.window.length_s",)
    assert reload.now.view.lookahead_s == running.view.lookahead_s
    assert reload.now.track.window == running.track.window


def test_a_changed_list_of_cameras_waits_for_a_restart() -> None:
    running = small_config()
    wanted = small_config([{"id": "c0", "source": "scene:room", "offset_s": 0.2}, "c1", "c2"])
    reload = plan_reload(running, wanted)
    assert (reload.site, reload.now.cameras) == (("cameras",), running.cameras)


def test_zones_of_other_cameras_wait_for_a_restart() -> None:
    zone = {"id": "door", "camera": "c2", "line": [[0, 0], [9, 0]], "inner": [4, 9]}
    reload = plan_reload(small_config(), small_config(["c0", "c2"], zones=[zone]))
    assert (reload.site, reload.now.zones) == (("cameras", "zones"), [])


def test_cameras_restart_when_sharpness_gets_a_weight() -> None:
    reload = plan_reload(small_config(), small_config(view={"quality": {"sharpness": 0.5}}))
    assert (reload.live, reload.cameras) == (("view.quality.sharpness",), CAMERAS)


def write(path: Path, **changes: Any) -> None:
    path.write_text(yaml.safe_dump({"cameras": [{"id": "c0", "source": "c0.mp4"}], **changes}))


def test_the_difference_to_an_invalid_changed_or_repaired_file_is_known(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    write(path)
    running = ActiveConfig(path)
    assert not running.on_disk().differs
    write(path, view={"lookahead_s": "many"})
    found = running.on_disk()
    assert "view.lookahead_s" in found.error
    assert found.differs
    with pytest.raises(UserError, match=r"view\.lookahead_s"):
        running.read_config_to_activate()
    write(path, view={"lookahead_s": 1.6}, site={"fps": 12.5})
    assert running.on_disk().changed_keys == ("site.fps", "view.lookahead_s")
    running.now = plan_reload(running.now, running.read_config_to_activate()).now
    assert running.on_disk().changed_keys == ("site.fps",)
    write(path, view={"lookahead_s": 1.6})
    assert not running.on_disk().differs


def test_a_changed_ground_file_is_a_difference(tmp_path: Path) -> None:
    path, ground = tmp_path / "site.yaml", tmp_path / "ground.json"
    write(path, ground="ground.json")
    ground.write_text('{"homography": {"c0": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}')
    running = ActiveConfig(path)
    assert not running.on_disk().differs
    ground.write_text('{"homography": {"c0": [[2, 0, 0], [0, 1, 0], [0, 0, 1]], "c1": [[1]]}}')
    assert "ground.json" in running.on_disk().error
    ground.write_text('{"homography": {"c0": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}}')
    assert running.on_disk().changed_keys == ("cameras.c0.ground",)


def test_processes_use_the_supervisors_active_configuration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, kept = tmp_path / "site.yaml", tmp_path / "elsewhere" / "kept.yaml"
    write(path, record={"folder": "recorded"}, access={"tokens": "tokens.yaml"})
    before = ActiveConfig(path).now
    kept.parent.mkdir()
    kept.write_text(serialize_with_absolute_paths(before, path.parent))
    write(path, site={"fps": "banana"})
    monkeypatch.setenv(ACTIVE_CONFIG_VARIABLE, str(kept))
    running = ActiveConfig(path)
    assert running.now == before
    assert "site.fps" in running.on_disk().error


def test_a_service_applies_a_reload_and_keeps_other_trial_settings() -> None:
    service = FedService(small_config())
    service.apply_live_view_settings(service.config.view.model_copy(update={"switch_cost_s": 3.0}))
    service.apply_config(small_config([{"id": "c0", "source": "scene:room", "offset_s": 0.16}, "c1"]))
    assert service.config.camera("c0").offset_s == 0.16
    assert service.decider.view.switch_cost_s == 3.0
    service.apply_config(small_config(view={"switch_cost_s": 2.0}))
    assert service.decider.view.switch_cost_s == service.config.view.switch_cost_s == 2.0
    before = service.config
    with pytest.raises(UserError, match="can be at most"):
        service.apply_config(small_config(view={"lookahead_s": 400.0}))
    assert service.config is before
    service.close()


@pytest.mark.parametrize(
    "found",
    [ConfigFileState("", ()), ConfigFileState("site.yaml: is wrong", ()), ConfigFileState("", ("site.fps",))],
)
async def test_the_operators_page_and_metrics_show_the_difference(found: ConfigFileState) -> None:
    service = FedService(small_config())
    async with (
        asyncio.timeout(PATIENCE),
        serving(make_app(BestViewService(service), lambda: found), HttpSettings(port=0)) as port,
        aiohttp.ClientSession(f"http://127.0.0.1:{port}") as session,
    ):
        response = await (await session.get("/api/operator/config")).json()
        metrics = await (await session.get("/metrics")).text()
    service.close()
    assert (response["error"], response["changed_keys"]) == (found.error, list(found.changed_keys))
    assert f"myview_config_differs {float(found.differs)}" in metrics


async def wait_for_output(terminal: int, text: bytes) -> None:
    output = b""
    while text not in output:
        output += await asyncio.to_thread(os.read, terminal, 4096)


@asynccontextmanager
async def sync_at_a_terminal(path: Path) -> AsyncIterator[tuple[asyncio.subprocess.Process, int]]:
    """Run a pulse server that logs to a terminal; return it and the terminal's other end once it sends."""
    port = free_port()
    write(path, sync={"port": port})
    controller, terminal_end = pty.openpty()
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server.cli.main", "sync", str(path)),
        stderr=terminal_end,
        start_new_session=True,
    )
    os.close(terminal_end)
    try:
        await wait_for_output(controller, b"pulses at")
        yield process, controller
    finally:
        if process.returncode is None:
            process.kill()  # its terminal is not read any more
            await process.wait()


async def test_a_process_logs_pending_and_invalid_settings_and_ends_with_its_terminal(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    async with asyncio.timeout(PATIENCE), sync_at_a_terminal(path) as (process, terminal):
        content = yaml.safe_load(path.read_text())
        for fps, line in (
            (12.5, b"restart of all processes: site.fps"),
            (-1, b"the previous configuration stays in force"),
        ):
            path.write_text(yaml.safe_dump({**content, "site": {"fps": fps}}))
            process.send_signal(signal.SIGHUP)
            await wait_for_output(terminal, line)
        assert process.returncode is None
        os.close(terminal)
        process.send_signal(signal.SIGHUP)
        assert await process.wait() == 0


def test_a_tracker_with_another_lag_waits_for_a_restart() -> None:
    running = small_config(view={"lookahead_s": 8.0})
    for track in ({"tracker": "temporal"}, {"tracker": "temporal", "temporal": {"window_stages": 2}}):
        reload = plan_reload(running, small_config(view={"lookahead_s": 8.0}, track=track))
        assert reload.now.track == running.track
        assert "track.tracker" in reload.site
    quicker = plan_reload(running, small_config(view={"lookahead_s": 8.0}, track={"tracker": "kalman"}))
    assert quicker.now.track.tracker == "kalman"
