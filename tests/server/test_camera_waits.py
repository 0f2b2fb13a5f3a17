"""A network camera that does not answer when its process starts is waited for."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from aiohttp import web
from free_port import free
from videos_by_hand import write_video

from server.run.camera import camera_process
from server.wire.running import Running

PATIENCE = 60.0  # seconds


class Lines(logging.Handler):
    """What is said in the log, for who waits for it."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._more = asyncio.Event()

    def emit(self, record: logging.LogRecord) -> None:
        """Take a line."""
        self.lines.append(record.getMessage())
        self._more.set()

    async def until(self, said: Callable[[str], bool]) -> None:
        """Wait until a line says so."""
        async with asyncio.timeout(PATIENCE):
            while not any(said(line) for line in self.lines):
                self._more.clear()
                await self._more.wait()


@pytest.mark.timeout(2 * PATIENCE + 10)
async def test_it_is_said_once_that_a_camera_does_not_answer_and_when_it_does_it_runs(tmp_path: Path) -> None:
    write_video(tmp_path / "c0.mp4", 25)
    port, bus = free(), f"tcp/127.0.0.1:{free()}"
    path = tmp_path / "site.yaml"
    content = {
        "site": {"name": "hall", "width": 64, "height": 48},
        "sync": {"port": free(), "start_timeout_s": 0.1},
        "zenoh": {"connect": bus, "listen": bus},
        "cameras": [{"id": "c0", "source": f"http://127.0.0.1:{port}/c0.mp4"}],
    }
    path.write_text(yaml.safe_dump(content))
    told, log = Lines(), logging.getLogger("server")
    log.addHandler(told)
    log.setLevel(logging.INFO)
    running = asyncio.create_task(camera_process(Running(path), "c0"))
    app = web.Application()
    app.router.add_static("/", tmp_path)
    runner = web.AppRunner(app)
    try:
        await told.until(lambda line: "Connection refused; it is tried again" in line)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", port).start()
        await told.until(lambda line: line.startswith("camera c0: it answers, after"))
        await told.until(lambda line: "no best-view service" in line)  # it runs
        assert sum("Connection refused" in line for line in told.lines) == 1
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await runner.cleanup()
        log.removeHandler(told)
        log.setLevel(logging.NOTSET)
