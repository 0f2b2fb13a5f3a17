"""Which cameras are tracked jointly: those of a common ground, unless single cameras have to be tracked."""

from __future__ import annotations

from typing import Any

import pytest

from fakes.service.joint_floor import joint_config
from server.supervisor.reload import plan_reload

WINDOW = {"window": {"length_s": 1.2, "stride_s": 0.2, "birth_s": 1.2, "min_frames": 3}}


def joint_cameras(**track: Any) -> list[str]:
    return list(joint_config(track={**WINDOW, **track}).joint_cameras)


def test_calibrated_cameras_are_tracked_jointly_by_default() -> None:
    assert joint_cameras() == ["c0", "c1", "c2"]
    assert joint_cameras(joint=False) == []


@pytest.mark.parametrize("track", [{"assist": {"enabled": True}}, {"tracker": "kalman"}])
def test_operators_and_baselines_know_single_cameras(track: dict[str, Any]) -> None:
    assert joint_cameras(**track) == []


def test_cameras_use_each_others_detections_where_each_is_tracked_alone() -> None:
    alone = joint_config(track={**WINDOW, "joint": False, "cross_view": {"enabled": True}})
    assert list(alone.peers_of("c0")) == ["c1", "c2"]
    assert list(joint_config(track={**WINDOW, "cross_view": {"enabled": True}}).peers_of("c0")) == []


@pytest.mark.parametrize("track", [{"assist": {"enabled": True}}, {"tracker": "kalman"}])
def test_a_running_site_goes_on_jointly_until_it_restarts(track: dict[str, Any]) -> None:
    running = joint_config(track=WINDOW)
    reload = plan_reload(running, joint_config(track={**WINDOW, **track}))
    assert reload.now.joint_cameras == running.joint_cameras
    assert reload.site
    assert not reload.cameras
