"""Debian's mosquitto, started for a test."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin:/usr/bin")
needs_mosquitto = pytest.mark.skipif(MOSQUITTO is None, reason="needs the broker mosquitto")


@dataclass(slots=True)
class Broker:
    """A broker that runs; ``lines`` are its configuration."""

    port: int
    folder: Path
    lines: tuple[str, ...]
    process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        path = self.folder / "mosquitto.conf"
        path.write_text("\n".join([*self.lines, "persistence false", ""]), encoding="utf-8")
        assert MOSQUITTO is not None
        self.process = await asyncio.create_subprocess_exec(
            MOSQUITTO, "-c", str(path), stderr=asyncio.subprocess.DEVNULL
        )
        async with asyncio.timeout(PATIENCE):
            while True:
                try:
                    _, writer = await asyncio.open_connection("127.0.0.1", self.port)
                except OSError:
                    await asyncio.sleep(0.05)
                    continue
                writer.close()
                return

    async def stop(self) -> None:
        assert self.process is not None
        if self.process.returncode is None:
            self.process.kill()
        await self.process.wait()


@asynccontextmanager
async def broker(folder: Path, *lines: str) -> AsyncIterator[Broker]:
    """Run a broker on a free port; without lines anyone may do anything."""
    port = free_port()
    # As root it would become a user who cannot read the test's folder.
    listener = ["user root", f"listener {port} 127.0.0.1", *(lines or ["allow_anonymous true"])]
    running = Broker(port, folder, tuple(listener))
    await running.start()
    try:
        yield running
    finally:
        await running.stop()


@asynccontextmanager
async def cable(port: int) -> AsyncIterator[Cable]:
    """Forward connections to a port of this machine, until a test cuts them."""
    found = Cable(port)
    server = await asyncio.start_server(found.forward, "127.0.0.1", 0)
    found.port = server.sockets[0].getsockname()[1]
    try:
        yield found
    finally:
        server.close()
        found.cut()


class Cable:
    """Connections to a port, by way of another one."""

    def __init__(self, to: int) -> None:
        self._to, self.port = to, 0
        self._writers: list[asyncio.StreamWriter] = []

    async def forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._to)
        self._writers += [writer, far_writer]
        await asyncio.gather(_pump(reader, far_writer), _pump(far_reader, writer))

    def cut(self) -> None:
        """End all connections without a word."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65_536):
            writer.write(data)


class Topics:
    """A subscriber that keeps the newest message of each topic, and awaits what it should become."""

    def __init__(self, client: aiomqtt.Client) -> None:
        self._client = client
        self.newest: dict[str, bytes] = {}
        self.counts: dict[str, int] = {}

    async def until(self, topic: str, wanted: Any) -> bytes:
        """Read messages until one topic has a payload for which ``wanted`` is true."""
        async with asyncio.timeout(PATIENCE):
            if topic in self.newest and wanted(self.newest[topic]):
                return self.newest[topic]
            async for message in self._client.messages:
                name = message.topic.value
                assert isinstance(message.payload, bytes)
                self.newest[name] = message.payload
                self.counts[name] = self.counts.get(name, 0) + 1
                if name == topic and wanted(message.payload):
                    return message.payload
        raise AssertionError("the broker has ended the connection")


@asynccontextmanager
async def listening(port: int, *topics: str, **settings: Any) -> AsyncIterator[Topics]:
    """Subscribe to topics of a broker."""
    async with aiomqtt.Client("127.0.0.1", port, **settings) as client:
        for topic in topics:
            await client.subscribe(topic, qos=1)
        yield Topics(client)
