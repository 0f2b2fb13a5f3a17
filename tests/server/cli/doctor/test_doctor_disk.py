"""`myview doctor` and the size of recordings: unknown bit rates are named."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from fakes.paths import ROOT
from server.cli.doctor.camera_probe import CameraProbe
from server.cli.doctor.disk import disk_findings, needed_mb
from server.cli.doctor.findings import Finding, Level
from server.config.loader import load_config
from server.config.site_config import Config

FREE_MB = 1000
HOUR_S = 3600.0
INDEX_KBPS = 8 * 100 * 25 / 1000
GOOD = CameraProbe(size=(64, 48), kbps=1000.0)
AWAY = CameraProbe("Connection refused")


def site(
    folder: Path, cameras: tuple[str, ...] = ("c0",), passthrough: str = "off", **changes: Any
) -> Config:
    content: dict[str, Any] = {
        "cameras": [
            {"id": camera, "source": f"{camera}.mp4", "passthrough": passthrough} for camera in cameras
        ],
        "record": {"folder": "kept", "keep_s": HOUR_S},
        **changes,
    }
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content))
    return load_config(path)


@pytest.fixture(autouse=True)
def disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate the free space of the disk."""
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=FREE_MB * 1e6))


def finding_of(findings: list[Finding], check: str) -> Finding:
    (found,) = [finding for finding in findings if finding.check == check]
    return found


def test_without_any_probed_camera_the_size_is_unknown(tmp_path: Path) -> None:
    found = finding_of(disk_findings(site(tmp_path), {"c0": AWAY}), "disk")
    assert found.level is Level.WARNING
    assert found.text.startswith("the size of 1.0 hours of c0 is not known; 1000 MB are free")


def test_the_size_is_that_of_probed_cameras_and_names_the_others(tmp_path: Path) -> None:
    both = site(tmp_path, ("c0", "c1"))
    found = finding_of(disk_findings(both, {"c0": AWAY, "c1": GOOD}), "disk")
    one = (1000 + INDEX_KBPS) * HOUR_S / 8000
    estimate = f"without c0, whose rate is not known, 1.0 hours of the cameras take about {one:.0f} MB; "
    assert found.level is Level.WARNING
    assert found.text.startswith(estimate)
    found = finding_of(disk_findings(both, {"c0": GOOD, "c1": GOOD}), "disk")
    assert (found.level, found.text.split(" take")[0]) == (Level.OK, "1.0 hours of these cameras")


def test_a_recording_that_surely_does_not_fit_is_bad(tmp_path: Path) -> None:
    large = CameraProbe(size=(64, 48), kbps=10_000.0)
    findings = disk_findings(site(tmp_path, ("c0", "c1")), {"c0": AWAY, "c1": large})
    assert finding_of(findings, "disk").level is Level.BAD
    small = site(tmp_path, ("c0", "c1"), record={"folder": "kept", "keep_s": HOUR_S, "max_mb": 46.0})
    findings = disk_findings(small, {"c0": AWAY, "c1": GOOD})
    assert "at most 6 minutes are kept" in finding_of(findings, "record.max_mb").text


def test_the_encoders_limit_is_assumed_for_cameras_that_were_not_probed(tmp_path: Path) -> None:
    capped = site(tmp_path, encode={"max_kbps": 500})
    found = finding_of(disk_findings(capped, {"c0": AWAY}), "disk")
    assert found.level is Level.OK
    assert "take about 234 MB, with c0 as encode.max_kbps allows; " in found.text
    assert "max_kbps" not in finding_of(disk_findings(capped, {"c0": GOOD}), "disk").text


def test_the_encoders_limit_is_not_assumed_for_passthrough_cameras(tmp_path: Path) -> None:
    tests_folder = site(tmp_path, passthrough="auto", encode={"max_kbps": 500})
    passing = CameraProbe(size=(64, 48), kbps=4000.0, passes=True)
    assert needed_mb(tests_folder, {"c0": passing}) == pytest.approx((4000 + INDEX_KBPS) * HOUR_S / 8000)
    assert needed_mb(tests_folder, {"c0": GOOD}) == pytest.approx((500 + INDEX_KBPS) * HOUR_S / 8000)
    assert finding_of(disk_findings(tests_folder, {"c0": AWAY}), "disk").level is Level.WARNING


def test_an_invalid_folder_name_is_reported_in_one_line(tmp_path: Path) -> None:
    (found,) = disk_findings(site(tmp_path, record={"folder": 300 * "a"}), {"c0": GOOD})
    assert (found.check, found.level) == ("record.folder", Level.BAD)
    assert found.text.endswith("cannot write there: File name too long")


AS_SOMEBODY = """
import os, sys
from pathlib import Path
from server.cli.doctor.disk import disk_findings
from server.config.loader import load_config
config = load_config(Path(sys.argv[1]))
if not os.geteuid():
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
for it in disk_findings(config, {}):
    print(it.check, it.level.value, it.text)
"""
"""As an unprivileged user: root may enter every folder."""


def test_an_inaccessible_parent_folder_is_named_in_one_line(tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory() as outside:  # pytest's folders are closed to others
        Path(outside).chmod(0o755)
        closed = Path(outside) / "closed"
        closed.mkdir()
        site(tmp_path, record={"folder": str(closed / "in" / "kept")})
        closed.chmod(0)
        try:
            result = subprocess.run(
                [sys.executable, "-c", AS_SOMEBODY, str(tmp_path / "site.yaml")],
                capture_output=True,
                text=True,
                check=False,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
            )
        finally:
            closed.chmod(0o755)
    assert result.stderr == ""
    assert result.stdout == f"record.folder bad {closed}: cannot write there: Permission denied\n"
