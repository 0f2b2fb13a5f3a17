"""A running RTSP gateway, and requests to it."""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.config.loader import build_config
from server.supervisor.rtsp_process import check_gateway_installed
from server.system.child_process import start_on_python
from server.system.errors import UserError

PYTHON = Path("/usr/bin/python3")
_CAMERA = {"id": "c0", "source": "scene:room"}


@cache
def gateway_is_installed() -> bool:
    try:
        check_gateway_installed(build_config({"cameras": [_CAMERA]}, where="site", folder=Path()))
    except UserError:
        return False
    return True


needs_gstreamer = pytest.mark.skipif(
    not gateway_is_installed(),
    reason="needs GStreamer's RTSP server (gir1.2-gst-rtsp-server-1.0, python3-gi)",
)


@dataclass(frozen=True)
class RunningGateway:
    """The process and its port."""

    process: asyncio.subprocess.Process
    port: int

    def url(self, path: str, token: str | None = None) -> str:
        login = "" if token is None else f"any:{token}@"
        return f"rtsp://{login}127.0.0.1:{self.port}{path}"

    async def describe(self, path: str, authorization: str | None = None) -> tuple[int, str]:
        """Send DESCRIBE; return the status and the whole head."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        lines = [
            f"DESCRIBE rtsp://127.0.0.1:{self.port}{path} RTSP/1.0",
            "CSeq: 1",
            "Accept: application/sdp",
        ]
        lines += [] if authorization is None else [f"Authorization: {authorization}"]
        writer.write("\r\n".join([*lines, "", ""]).encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode()
        writer.close()
        return int(head.split()[1]), head


def basic(name: str, password: str) -> str:
    return f"Basic {base64.b64encode(f'{name}:{password}'.encode()).decode()}"


@asynccontextmanager
async def run_gateway(service_port: int, **changes: Any) -> AsyncIterator[RunningGateway]:
    """Run the gateway of a service on this machine."""
    process = await start_on_python(PYTHON, "server.rtsp", 65_536)
    settings = {
        "service": f"http://127.0.0.1:{service_port}",
        "service_certificate": None,
        "host": "127.0.0.1",
        "port": free_port(),
        "clients_max": 8,
        "udp": True,
        "certificate": None,
        "key": None,
        **changes,
    }
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps(settings).encode() + b"\n")
    try:
        line = await asyncio.wait_for(process.stdout.readline(), PATIENCE)
        assert b"streams on" in line, line
        logged = asyncio.create_task(process.stdout.read())  # so that its pipe never fills
        yield RunningGateway(process, settings["port"])
        process.stdin.close()
        assert await asyncio.wait_for(process.wait(), PATIENCE) == 0, "it ends with its input"
        assert b"Traceback" not in await logged, (await logged).decode()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
