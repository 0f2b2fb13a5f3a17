"""A process that refuses to start says why to its supervisor."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fakes.timeouts import PATIENCE
from server.cli import main
from server.supervisor.startup_signal import REFUSAL_VARIABLE, report_refusal

NAME = os.fsdecode(b"caf\xe9.yaml")
"""As in Latin 1, which is no UTF-8."""


def test_a_path_that_is_no_text_is_reported_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "refusal"
    monkeypatch.setenv(REFUSAL_VARIABLE, str(file))
    report_refusal(f"{NAME}: cannot read")
    assert file.read_text(encoding="utf-8") == "caf\\udce9.yaml: cannot read"


def test_a_reason_replaces_another_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "refusal"
    monkeypatch.setenv(REFUSAL_VARIABLE, str(file))
    report_refusal("another process's reason")
    with file.open(encoding="utf-8") as reader:  # reads while the next one is written
        report_refusal("this one")
        assert reader.read() == "another process's reason"
    assert file.read_text(encoding="utf-8") == "this one"
    assert list(tmp_path.iterdir()) == [file]


def test_a_path_that_cannot_be_accessed_is_reported_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "refusal"
    monkeypatch.setenv(REFUSAL_VARIABLE, str(file))
    with pytest.raises(SystemExit) as ended:
        main._fail(PermissionError(errno.EACCES, "Permission denied", "ground.json"))
    assert ended.value.code == 2
    assert file.read_text(encoding="utf-8") == "ground.json: Permission denied"


def test_a_command_that_cannot_read_its_file_reports_it_and_exits_with_2(tmp_path: Path) -> None:
    file = tmp_path / "refusal"
    ended = subprocess.run(
        [sys.executable, "-m", "server.cli.main", "sync", NAME],
        env={**os.environ, REFUSAL_VARIABLE: str(file)},
        capture_output=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (ended.returncode, b"Traceback" in ended.stderr) == (2, False)
    assert "caf" in file.read_text(encoding="utf-8")
