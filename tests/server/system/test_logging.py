"""Log lines as text and as JSON."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import time
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.system.errors import UserError
from server.system.log_format import JsonLines, formatter
from server.system.log_setup import report_error

FIELDS = {"time", "level", "process", "logger", "event"}


def record(message: str, *values: object, level: int = logging.INFO, error: Any = None) -> logging.LogRecord:
    return logging.LogRecord("server.service.ingest.ingest", level, __file__, 1, message, values, error)


def line(message: str, *values: object, **more: Any) -> dict[str, Any]:
    written = JsonLines("bestview").format(record(message, *values, **more))
    assert "\n" not in written
    return dict(json.loads(written))


def test_a_line_has_time_level_process_and_event() -> None:
    before = time.time()
    logged = line("camera %s disconnected", "c1", level=logging.WARNING)
    assert datetime.fromisoformat(logged.pop("time")).timestamp() == pytest.approx(before, abs=5.0)
    assert logged == {
        "level": "WARNING",
        "process": "bestview",
        "logger": "server.service.ingest.ingest",
        "event": "camera c1 disconnected",
        "camera": "c1",
    }


@pytest.mark.parametrize(
    ("message", "values", "about"),
    [
        (
            "camera %s: detections of camera %s in frame %d arrived too late",
            ("c0", "c1", 7),
            {"camera": "c0"},
        ),
        ("drawing object %d on camera %s", (3, "c1"), {"object": 3, "camera": "c1"}),
        ("100 %% of camera %s after %.1f s", ("c2", 0.5), {"camera": "c2"}),
        ("%d frames of %-5s camera %s", (4, "the", "c2"), {"camera": "c2"}),
        ("every camera's recording has ended", (), {}),
        ("camera %s went to camera %s", ("a", "b"), {"camera": "a"}),
    ],
)
def test_the_camera_or_object_of_a_line_is_a_field(
    message: str, values: tuple[object, ...], about: dict[str, object]
) -> None:
    logged = line(message, *values)
    assert logged["event"] == message % values
    assert {key: logged[key] for key in logged if key not in FIELDS} == about


@given(st.text(), st.text())
def test_every_record_is_one_line(camera: str, reason: str) -> None:
    logged = line("camera %s: %s", camera, reason)
    assert logged["event"] == f"camera {camera}: {reason}"
    assert logged["camera"] == camera


def test_a_file_name_that_is_not_utf_8_is_escaped() -> None:
    logged = line("camera %s: cannot read %s", "c\udc80", Path("a\udc81b"))
    assert logged["event"] == r"camera c\udc80: cannot read a\udc81b"
    assert logged["camera"] == r"c\udc80"


def test_error_lines_have_no_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    report_error("hall says: \x1b[2Jgone\nand more")
    assert capsys.readouterr().err == "myview: hall says: ·[2Jgone and more\n"


def test_a_traceback_is_a_field_of_the_line() -> None:
    try:
        int("what went wrong")
    except ValueError:
        logged = line("it failed", error=sys.exc_info())
    assert "ValueError: invalid literal" in logged["traceback"]


def test_an_unknown_format_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_LOG_FORMAT", "xml")
    with pytest.raises(UserError, match="MYVIEW_LOG_FORMAT: is 'xml', not text or json"):
        formatter("c0")
    monkeypatch.setenv("MYVIEW_LOG_FORMAT", "")
    assert formatter("100%").format(record("camera %s", "c0")).endswith("INFO    100%: camera c0")


def site(folder: Path, **changes: Any) -> Path:
    ports = [free_port() for _ in range(3)]
    content = {
        "site": {"width": 64, "height": 48},
        "cameras": [{"id": "c0", "source": "scene:room"}],
        "http": {"port": ports[0]},
        "sync": {"port": ports[1], "start_timeout_s": 0.1},
        "zenoh": dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{ports[2]}"),
        **changes,
    }
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def run_with_json_log(*arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "server.cli.main", *map(str, arguments)]
    environment = {**os.environ, "MYVIEW_LOG_FORMAT": "json", "MYVIEW_LOG": "DEBUG"}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)


@pytest.mark.slow
def test_every_line_of_a_whole_site_can_be_parsed(tmp_path: Path) -> None:
    with run_with_json_log("up", site(tmp_path)) as up:
        assert up.stderr is not None
        lines = []
        for written in up.stderr:
            lines.append(json.loads(written))
            if lines[-1]["event"] == "camera c0 connected":
                up.send_signal(signal.SIGTERM)
        assert up.wait(PATIENCE) == 0
    assert all(set(line) >= FIELDS for line in lines)
    assert {line["process"] for line in lines} >= {"bestview", "c0", "sync"}
    assert "camera c0 connected" in {line["event"] for line in lines if line.get("camera") == "c0"}


def test_the_reason_why_a_process_does_not_start_is_logged(tmp_path: Path) -> None:
    with run_with_json_log("camera", site(tmp_path), "c9") as refused:
        _, written = refused.communicate(timeout=PATIENCE)
        assert refused.returncode == 2
    logged = json.loads(written)
    assert logged["level"] == "ERROR"
    assert "there is no camera 'c9'" in logged["event"]
