"""A network camera that does not answer when its process starts is retried, and so is one that changes."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
import yaml
from aiohttp import web

from expbackoff import Backoff
from fakes.media.videos import write_video
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.camera.sources import stream_reader
from server.config.running_config import ActiveConfig
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.camera_status import UnavailableCamera
from server.messaging.messages import ZenohKeys
from server.supervisor import camera_process as camera_module
from server.supervisor.camera_process import camera_process
from server.system.errors import UnavailableError


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


class ResizingCamera:
    """A motion JPEG camera that ends each connection soon; at the next one its pictures have another size."""

    def __init__(self) -> None:
        self._connections = 0

    async def serve(self, request: web.Request) -> web.StreamResponse:
        """Send the pictures of a connection."""
        self._connections += 1
        pixels = np.zeros((48, 64 * (1 + self._connections % 2), 3), np.uint8)
        jpeg = cv2.imencode(".jpg", pixels)[1].tobytes()
        response = web.StreamResponse(headers={"Content-Type": "multipart/x-mixed-replace; boundary=frame"})
        await response.prepare(request)
        for _ in range(5):
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            await response.write(head.encode() + jpeg + b"\r\n")
            await asyncio.sleep(0.02)
        return response


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
async def begin(tmp_path: Path) -> AsyncIterator[Callable[..., Awaitable[Site]]]:
    """Start a camera process with the site's width, the setting ``passthrough`` and a path of the camera.

    ``answers``: the camera answers already.
    """
    write_video(tmp_path / "c0.mp4", 25)
    log_lines, log = LogLines(), logging.getLogger("server")
    log.addHandler(log_lines)
    log.setLevel(logging.INFO)
    app = web.Application()
    app.router.add_get("/resizing", ResizingCamera().serve)
    app.router.add_static("/", tmp_path)
    runner = web.AppRunner(app)
    running_tasks: list[asyncio.Task[None]] = []

    async def begin(
        width: int = 64, passthrough: str = "off", camera: str = "c0.mp4", *, answers: bool = False
    ) -> Site:
        port, bus, sync = free_port(), f"tcp/127.0.0.1:{free_port()}", free_port()
        path = tmp_path / "site.yaml"

        def write(passthrough: str) -> None:
            source = f"http://127.0.0.1:{port}/{camera}"
            content = {
                "site": {"name": "hall", "width": width, "height": 48},
                "sync": {"port": sync, "start_timeout_s": 0.1},
                "zenoh": {"connect": bus, "listen": bus},
                "cameras": [{"id": "c0", "source": source, "passthrough": passthrough}],
            }
            path.write_text(yaml.safe_dump(content))

        write(passthrough)

        async def answer() -> None:
            await runner.setup()
            await web.TCPSite(runner, "127.0.0.1", port).start()

        if answers:
            await answer()
        running = ActiveConfig(path)
        running_tasks.append(asyncio.create_task(camera_process(running, "c0")))
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
    begin: Callable[..., Awaitable[Site]],
) -> None:
    site = await begin()
    await site.log_lines.until(lambda line: "Connection refused; retrying" in line)
    await site.answer()
    await site.log_lines.until(lambda line: line.startswith("camera c0 is available, after"))
    await site.log_lines.until(lambda line: "no best-view service" in line)  # it runs
    assert sum("Connection refused" in line for line in site.log_lines.lines) == 1


@pytest.mark.timeout(3 * PATIENCE + 10)
async def test_a_camera_whose_video_does_not_fit_once_the_site_runs_is_tried_again_and_returns(
    begin: Callable[..., Awaitable[Site]],
) -> None:
    """At the start such an error ends the site; here the others already run."""
    site = await begin(128, "pass")
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


@pytest.mark.timeout(3 * PATIENCE + 10)
async def test_services_are_told_why_a_camera_that_changes_waits_and_how_long(
    begin: Callable[..., Awaitable[Site]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service that connects during the pause is told what is left of it."""
    pause_s = 60.0
    monkeypatch.setattr(camera_module, "_RETRY_FIRST_S", pause_s)
    monkeypatch.setattr(camera_module, "_RETRY_MAX_S", pause_s)
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.01)
    site = await begin(camera="resizing", answers=True)
    await site.log_lines.until(lambda line: "its images are" in line)
    changed = asyncio.get_running_loop().time()
    bus, messages = Bus.router(site.config.zenoh), asyncio.Queue[UnavailableCamera]()
    try:
        keys = ZenohKeys(site.config.site.name)
        bus.subscribe(
            keys.camera("c0", "unavailable"),
            lambda message: messages.put_nowait(
                msgspec.msgpack.decode(message.payload, type=UnavailableCamera)
            ),
        )
        waited_s = asyncio.get_running_loop().time() - changed
        bus.declare_alive(keys.bestview("alive"))
        async with asyncio.timeout(PATIENCE):
            told = await messages.get()
    finally:
        bus.close()
    assert told.cause == "changed"
    assert told.reason.partition(": ")[2] in {
        f"its images are {now} now, they were {before}"
        for now, before in (("64x48", "128x48"), ("128x48", "64x48"))
    }
    assert 0.0 < told.retry_s <= pause_s - waited_s


@pytest.mark.timeout(3 * PATIENCE + 10)
@pytest.mark.parametrize(("stable_s", "delays"), [(10.0, [0.5, 1.0, 2.0]), (0.0, [0.5] * 3)])
async def test_a_camera_that_changes_again_and_again_is_opened_less_and_less_often(
    begin: Callable[..., Awaitable[Site]],
    monkeypatch: pytest.MonkeyPatch,
    stable_s: float,
    delays: list[float],
) -> None:
    """Each opening loads detector and tracker. A camera that has run for some time is soon opened again."""
    waited, is_enough = list[float](), asyncio.Event()

    class Recorded(Backoff):
        def next(self) -> float:
            waited.append(super().next())
            if len(waited) == len(delays):
                is_enough.set()
            return 0.01

    monkeypatch.setattr(camera_module, "Backoff", Recorded)
    monkeypatch.setattr(camera_module, "_STABLE_S", stable_s)
    monkeypatch.setattr(stream_reader, "_RETRY_FIRST_S", 0.01)
    site = await begin(camera="resizing", answers=True)
    async with asyncio.timeout(2 * PATIENCE):
        await is_enough.wait()
    assert waited == delays
    assert not site.process.done()
    changes = [line for line in site.log_lines.lines if "its images are" in line]
    assert 1 <= len(changes) <= 2, "one line for each change: larger, and smaller again"


async def test_other_settings_are_tried_as_if_nothing_had_failed(tmp_path: Path) -> None:
    bus = f"tcp/127.0.0.1:{free_port()}"
    content = {"cameras": [{"id": "c0", "source": "scene:room"}], "zenoh": {"connect": bus, "listen": bus}}
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(content))
    restart = asyncio.Event()
    restart.set()
    with closing(camera_module._Attempts(ActiveConfig(tmp_path / "site.yaml"), "c0", restart)) as attempts:
        for _ in range(5):
            await attempts.failed(UnavailableError("c0: no route"))
    assert attempts._backoff.failures == 0
