"""A process that refuses to start says why to its supervisor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fakes.timeouts import PATIENCE
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


@pytest.mark.parametrize("name", [NAME, "n" * 300])
def test_a_command_that_cannot_read_its_file_reports_it_and_exits_with_2(tmp_path: Path, name: str) -> None:
    file = tmp_path / "refusal"
    ended = subprocess.run(  # noqa: S603 — this test's own command
        [sys.executable, "-m", "server.cli.main", "sync", name],
        env={**os.environ, REFUSAL_VARIABLE: str(file)},
        capture_output=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (ended.returncode, b"Traceback" in ended.stderr) == (2, False)
    assert name[:3] in file.read_text(encoding="utf-8")
