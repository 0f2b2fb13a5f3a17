"""The demo runs at a rate that the machine can sustain, or at a configured one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import yaml

from server.cli.demo import demo_fps
from server.cli.generated_config import demo_config
from server.system.processors import available_processors

THERE = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@pytest.mark.parametrize(
    ("processors", "fps"), [(0.5, 6.25), (1, 6.25), (2, 12.5), (3.9, 12.5), (4, 25), (64, 25)]
)
def test_the_rate_depends_on_the_processors(processors: float, fps: float) -> None:
    assert demo_fps(processors) == fps


def test_the_environment_overrides_the_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, config = demo_config(tmp_path, 0, 12.5)
    assert config.site.fps == 12.5
    assert yaml.safe_load(path.read_text())["site"]["width"] == config.site.width
    monkeypatch.setenv("MYVIEW_SITE__FPS", "5")
    assert demo_config(tmp_path, 0, 12.5)[1].site.fps == 5


def write_files(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name.replace("_", ".", 1)).write_text(text)


@pytest.mark.parametrize(
    ("own", "above", "limit"),
    [
        ("50000 100000", "max 100000", 0.5),
        ("max 100000", "25000 100000", 0.25),
        ("70000 100000", "30000 100000", 0.3),
        ("max 100000", "max 100000", THERE),
        ("6400000 100000", "max 100000", min(64, THERE)),
        ("what is this", "", THERE),
    ],
)
def test_the_lowest_limit_of_a_containers_groups_counts(
    tmp_path: Path, own: str, above: str, limit: float
) -> None:
    write_files(tmp_path / "groups" / "a" / "b", cpu_max=own)
    write_files(tmp_path / "groups" / "a", cpu_max=above)
    (tmp_path / "cgroup").write_text("0::/a/b\n")
    assert available_processors(tmp_path / "groups", tmp_path / "cgroup") == limit


@pytest.mark.parametrize(("quota", "limit"), [("20000", 0.2), ("-1", THERE)])
def test_version_1_groups_count(tmp_path: Path, quota: str, limit: float) -> None:
    write_files(tmp_path / "groups" / "cpu" / "a", cpu_cfs_quota_us=quota, cpu_cfs_period_us="100000")
    (tmp_path / "cgroup").write_text("4:memory:/z\n2:cpu,cpuacct:/a\n")
    assert available_processors(tmp_path / "groups", tmp_path / "cgroup") == limit


def test_without_groups_all_processors_count(tmp_path: Path) -> None:
    assert available_processors(tmp_path, tmp_path / "none") == THERE
