"""File descriptors: the limit is raised, and some are reserved for uses other than viewers."""

from __future__ import annotations

import asyncio
import errno
import json
import resource
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NoReturn

import pytest

from fakes.cli.command_line import RunCommand
from fakes.service.scripted_cameras import small_config
from fakes.system.few_descriptors import FEW_DESCRIPTORS, MYVIEW, connect, running, wait_for_log, write_site
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.cli.doctor.findings import Level
from server.cli.doctor.machine import descriptor_findings
from server.http.connections.connection_limit import FOR_OPERATORS, connection_limit
from server.system.accept_errors import AcceptErrors
from server.system.descriptors import descriptor_limit, raise_descriptor_limit


@pytest.fixture
def low_limit() -> Iterator[int]:
    """Lower this process's soft limit; yield the hard one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (512, hard))
    yield hard
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_the_soft_limit_is_raised_to_the_hard_one(low_limit: int) -> None:
    assert descriptor_limit() == 512
    raise_descriptor_limit()
    assert descriptor_limit() == min(low_limit, 1 << 20) > 512


def test_every_command_raises_the_limit_for_itself_and_its_children(
    low_limit: int, myview: RunCommand
) -> None:
    assert myview("--version").code == 0
    child = [sys.executable, "-c", "import resource; print(resource.getrlimit(resource.RLIMIT_NOFILE)[0])"]
    shown = subprocess.run(child, check=True, capture_output=True, text=True)
    assert int(shown.stdout) == descriptor_limit() == min(low_limit, 1 << 20)


@pytest.mark.parametrize("descriptors", [256, 512, 1024, 4096, 1 << 20])
@pytest.mark.parametrize("record", [{}, {"folder": "kept"}])
def test_descriptors_are_reserved_for_other_uses(descriptors: int, record: dict[str, Any]) -> None:
    config = small_config(record=record, http={"viewers_max": 300, "connections_max": 2000})
    limit = connection_limit(config, descriptors)
    files = min(config.http.viewers_max, limit) if record else 0  # time shift: one for each viewer
    assert 0 < limit <= 2000
    assert limit == 2000 or limit + files + FOR_OPERATORS + 128 <= descriptors
    assert (limit == 2000) == (descriptors >= 4096)


def test_the_default_limit_has_connections_for_all_viewers() -> None:
    assert small_config().http.connections == 4000
    assert small_config(http={"viewers_max": 2}).http.connections == 1000
    assert small_config(http={"viewers_max": 9000}).http.connections == 36000
    assert small_config(http={"viewers_max": 9000, "connections_max": 7}).http.connections == 7


def test_the_doctor_reports_the_connections_that_fit() -> None:
    (found,) = descriptor_findings(small_config(), 1 << 20)
    assert found.level is Level.OK
    assert "4000 connections and 1000 viewers" in found.text
    (found,) = descriptor_findings(small_config(), 4096)
    assert found.level is Level.WARNING
    assert "1000 viewers among them; http.connections_max is 4000" in found.text
    (found,) = descriptor_findings(small_config(), 1024)
    assert found.level is Level.WARNING
    assert "http.viewers_max is 1000" in found.text
    assert "LimitNOFILE" in found.remedy


def test_the_doctor_includes_the_check_of_open_files(myview: RunCommand, tmp_path: Path) -> None:
    path = write_site(tmp_path, free_port())
    report = json.loads(myview("doctor", path, "--json", "--seconds", 1).out)
    (found,) = [finding for finding in report["findings"] if finding["check"] == "open files"]
    assert str(descriptor_limit()) in found["text"]


def test_failures_to_accept_are_logged_once_and_connections_are_accepted_later(tmp_path: Path) -> None:
    port, log = free_port(), tmp_path / "log"
    with running(f"{MYVIEW} sync {write_site(tmp_path, port)}", log), ExitStack() as silent:
        for _ in range(FEW_DESCRIPTORS + 16):  # within the listen backlog
            silent.enter_context(connect(port))
        wait_for_log(log, b"Too many open files")
        silent.close()
        with connect(port) as late:
            late.settimeout(PATIENCE)
            assert late.recv(12) == b"MYVIEW-SYNC ", "connections are accepted again"
    log_text = log.read_bytes()
    assert log_text.count(b"cannot be accepted: Too many open files") == 1
    assert b"Traceback" not in log_text


class FullListener(socket.socket):
    """A listening socket of a process without free descriptors."""

    def accept(self) -> NoReturn:
        raise OSError(errno.EMFILE, "Too many open files")


async def test_a_server_closed_while_descriptors_are_exhausted_logs_no_traceback(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("asyncio.constants.ACCEPT_RETRY_DELAY", 0.01)
    loop, errors, contexts = asyncio.get_running_loop(), AcceptErrors(), asyncio.Queue[dict[str, Any]]()

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        errors(loop, context)
        contexts.put_nowait(context)

    loop.set_exception_handler(handle)
    listener = FullListener()
    listener.bind(("127.0.0.1", 0))
    server = await loop.create_server(asyncio.Protocol, sock=listener)
    async with asyncio.timeout(PATIENCE):
        with connect(listener.getsockname()[1]):
            assert "socket" in await contexts.get()
            server.close()
            while not isinstance((await contexts.get())["exception"], ValueError):
                pass  # asyncio tries as often as the listen backlog, then again on the closed socket
    assert [record.getMessage() for record in caplog.records] == [
        "a connection cannot be accepted: Too many open files"
    ]
