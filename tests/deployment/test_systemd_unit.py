"""The unit for systemd: valid, and with few rights. `test_systemd.py` in tests/e2e runs it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from fakes.paths import ROOT
from fakes.programs import needs_systemd_analyze

UNIT = ROOT / "configs" / "myview@.service"
EXPOSURE = 25
"""Tenths of `systemd-analyze security`; from 40 on it calls a service medium instead of OK."""


@needs_systemd_analyze
@pytest.mark.parametrize("command", [["verify"], ["security", "--offline=true", f"--threshold={EXPOSURE}"]])
def test_the_unit_is_valid_and_has_few_rights(tmp_path: Path, command: list[str]) -> None:
    unit = tmp_path / UNIT.name
    # An installed program, which `verify` looks for.
    unit.write_text(UNIT.read_text(encoding="utf-8").replace("/opt/myview/bin/myview", "/bin/true"))
    done = subprocess.run(
        ["systemd-analyze", *command, unit], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr
