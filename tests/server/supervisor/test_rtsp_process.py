"""The RTSP gateway's process: what it needs, what it tells the gateway, and one line for everything else."""

from __future__ import annotations

import asyncio
import socket
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from fakes.cli.command_line import RunCommand, input_error
from fakes.rtsp.gateway import needs_gstreamer
from fakes.service.scripted_cameras import small_config
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.supervisor.rtsp_process import gateway_settings
from server.system.errors import UserError


def write_site(folder: Path, **rtsp: Any) -> Path:
    path = folder / "site.yaml"
    content = {"cameras": [{"id": "c0", "source": "scene:room"}], "http": {"port": free_port()}, "rtsp": rtsp}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("command", ["rtsp", "up"])
@pytest.mark.parametrize(
    ("python", "reason"), [("no-python", "No such file"), (sys.executable, "No module named 'gi'")]
)
def test_without_gstreamer_one_line_says_what_to_install(
    myview: RunCommand, tmp_path: Path, command: str, python: str, reason: str
) -> None:
    line = input_error(myview(command, write_site(tmp_path, enabled=True, port=free_port(), python=python)))
    assert reason in line
    assert "apt install python3-gi gir1.2-gst-rtsp-server-1.0" in line


def test_without_tokens_it_is_for_this_machine_alone(myview: RunCommand, tmp_path: Path) -> None:
    outside = "0.0.0.0"  # noqa: S104 — what the test is about
    line = input_error(myview("rtsp", write_site(tmp_path, host=outside, port=free_port())))
    assert "rtsp.host: 0.0.0.0 lets other machines watch" in line


@pytest.mark.parametrize(
    ("http", "service"),
    [
        ({"port": 8080}, "http://127.0.0.1:8080"),
        ({"host": "0.0.0.0", "port": 8080}, "http://127.0.0.1:8080"),  # noqa: S104
        ({"host": "::", "port": 8080}, "http://[::1]:8080"),
        ({"host": "fd00::7", "port": 8080}, "http://[fd00::7]:8080"),
        ({"tls": {"certificate": "c.pem", "key": "k.pem"}, "port": 443}, "https://127.0.0.1:443"),
    ],
)
def test_the_service_is_where_the_site_says(http: dict[str, Any], service: str) -> None:
    settings = gateway_settings(small_config(http=http))
    assert settings["service"] == service
    assert settings["service_certificate"] == ("c.pem" if "tls" in http else None)
    other = gateway_settings(small_config(http=http, rtsp={"service": "http://10.0.0.5:80"}))
    assert other["service"] == "http://10.0.0.5:80"


def test_a_port_that_the_system_chooses_is_unknown_to_it() -> None:
    with pytest.raises(UserError, match=r"set http\.port"):
        gateway_settings(small_config(http={"port": 0}))


@needs_gstreamer
async def test_the_command_serves_until_it_is_told_to_end(tmp_path: Path) -> None:
    port = free_port()
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server.cli.main", "rtsp", str(write_site(tmp_path, port=port))),
        stderr=asyncio.subprocess.PIPE,
    )
    assert process.stderr is not None
    async with asyncio.timeout(PATIENCE):
        line = (await process.stderr.readline()).decode()
        assert f"INFO    rtsp: streams on rtsp://127.0.0.1:{port}/objects/1" in line
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(f"DESCRIBE rtsp://127.0.0.1:{port}/cameras/c0 RTSP/1.0\r\nCSeq: 1\r\n\r\n".encode())
        assert (await reader.readline()).startswith(b"RTSP/1.0 503")
        line = (await process.stderr.readline()).decode()
        assert "WARNING rtsp: /cameras/c0/live.mp4: the service is away" in line
        writer.close()
        process.terminate()
        assert await process.wait() == 0
    with pytest.raises(OSError, match=r"refused|Connect call failed"):
        await asyncio.open_connection("127.0.0.1", port)


@needs_gstreamer
def test_a_port_in_use_is_one_line(myview: RunCommand, tmp_path: Path, unused_tcp_port: int) -> None:
    with socket.create_server(("127.0.0.1", unused_tcp_port)):
        line = input_error(myview("rtsp", write_site(tmp_path, port=unused_tcp_port)))
    assert line == f"myview: rtsp.port: cannot listen on 127.0.0.1:{unused_tcp_port}"
