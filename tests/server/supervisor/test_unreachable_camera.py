"""A network camera that does not answer when its process starts is retried."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest
import yaml
from aiohttp import web

from fakes.media.videos import write_video
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.config.running_config import ActiveConfig
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.messages import ZenohKeys
from server.supervisor.camera_process import camera_process


class LogLines(logging.Handler):
    """A log handler that lets a test wait for lines."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._more = asyncio.Event()

    def emit(self, record: logging.LogRecord) -> None:
        """Record a line."""
        self.lines.append(record.getMessage())
        self._more.set()

    async def until(self, condition: Callable[[str], bool]) -> None:
        """Wait until a line fulfills a condition."""
        async with asyncio.timeout(PATIENCE):
            while not any(condition(line) for line in self.lines):
                self._more.clear()
                await self._more.wait()


@dataclass
class Site:
    """A camera process whose network camera does not answer yet."""

    process: asyncio.Task[None]
    log_lines: LogLines
    answer: Callable[[], Awaitable[None]]
    """Let the camera answer."""
    write: Callable[..., None]
    """Write the configuration with the setting ``passthrough``."""
    config: Config


@pytest.fixture
async def begin(tmp_path: Path) -> AsyncIterator[Callable[..., Site]]:
    """Start a camera process with the site's width and the setting ``passthrough``."""
    write_video(tmp_path / "c0.mp4", 25)
    log_lines, log = LogLines(), logging.getLogger("server")
    log.addHandler(log_lines)
    log.setLevel(logging.INFO)
    app = web.Application()
    app.router.add_static("/", tmp_path)
    runner = web.AppRunner(app)
    running_tasks: list[asyncio.Task[None]] = []

    def begin(width: int = 64, passthrough: str = "off") -> Site:
        port, bus, sync = free_port(), f"tcp/127.0.0.1:{free_port()}", free_port()
        path = tmp_path / "site.yaml"

        def write(passthrough: str) -> None:
            source = f"http://127.0.0.1:{port}/c0.mp4"
            content = {
                "site": {"name": "hall", "width": width, "height": 48},
                "sync": {"port": sync, "start_timeout_s": 0.1},
                "zenoh": {"connect": bus, "listen": bus},
                "cameras": [{"id": "c0", "source": source, "passthrough": passthrough}],
            }
            path.write_text(yaml.safe_dump(content))

        write(passthrough)
        running = ActiveConfig(path)
        running_tasks.append(asyncio.create_task(camera_process(running, "c0")))

        async def answer() -> None:
            await runner.setup()
            await web.TCPSite(runner, "127.0.0.1", port).start()

        return Site(running_tasks[-1], log_lines, answer, write, running.now)

    yield begin
    for process in running_tasks:
        process.cancel()
    await asyncio.gather(*running_tasks, return_exceptions=True)
    await runner.cleanup()
    log.removeHandler(log_lines)
    log.setLevel(logging.NOTSET)


@pytest.mark.timeout(2 * PATIENCE + 10)
async def test_an_unreachable_camera_is_logged_once_and_runs_when_it_answers(
    begin: Callable[..., Site],
) -> None:
    site = begin()
    await site.log_lines.until(lambda line: "Connection refused; retrying" in line)
    await site.answer()
    await site.log_lines.until(lambda line: line.startswith("camera c0 is available, after"))
    await site.log_lines.until(lambda line: "no best-view service" in line)  # it runs
    assert sum("Connection refused" in line for line in site.log_lines.lines) == 1


@pytest.mark.timeout(3 * PATIENCE + 10)
async def test_a_camera_whose_video_does_not_fit_once_the_site_runs_is_tried_again_and_returns(
    begin: Callable[..., Site],
) -> None:
    """At the start such an error ends the site; here the others already run."""
    site = begin(128, "pass")
    await site.log_lines.until(lambda line: "Connection refused; retrying" in line)
    bus, reasons = Bus.router(site.config.zenoh), asyncio.Queue[str]()
    try:
        keys = ZenohKeys(site.config.site.name)
        bus.subscribe(
            keys.camera("c0", "unavailable"),
            lambda message: reasons.put_nowait(msgspec.msgpack.decode(message.payload)["reason"]),
        )
        bus.declare_alive(keys.bestview("alive"))
        async with asyncio.timeout(PATIENCE):
            assert "Connection refused" in await reasons.get(), "a service that comes later is told"
            await site.answer()
            while "Connection refused" in (reason := await reasons.get()):
                pass
        assert reason.startswith("passthrough: pass: its frames are 64x48, the site's 128x48")
        misfit = f"camera c0: {reason}"
        await site.log_lines.until(lambda line: line.startswith(misfit) and line.endswith("; retrying"))
        assert not site.process.done()
        site.write(passthrough="auto")
        os.kill(os.getpid(), signal.SIGHUP)
        await site.log_lines.until(lambda line: line.startswith("camera c0 is re-encoded: its own video"))
        await site.log_lines.until(lambda line: line.startswith("camera c0 is available, after"))
    finally:
        bus.close()
    assert sum(line.startswith(misfit) for line in site.log_lines.lines) == 1
