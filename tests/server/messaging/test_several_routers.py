"""Several routers on the bus: each message arrives once at each, and one that stops holds up no other."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, asynccontextmanager

import pytest

from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.config.sections import ZenohSettings
from server.messaging.bus import Bus
from server.messaging.inbox import Message

_ROUTER = """
import asyncio, sys
from server.config.sections import ZenohSettings
from server.messaging.bus import Bus

async def run():
    bus = Bus.router(ZenohSettings(listen=sys.argv[1]))
    bus.subscribe("camera/**", lambda _: None)
    bus.declare_alive("service/second")
    print("listening", flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    bus.close()

asyncio.run(run())
"""


class Received:
    """Received payloads, awaitable."""

    def __init__(self) -> None:
        self.payloads: list[bytes] = []
        self._changed = asyncio.Event()

    def put(self, message: Message) -> None:
        self.payloads.append(message.payload)
        self._changed.set()

    async def until(self, last: bytes) -> None:
        async with asyncio.timeout(PATIENCE):
            while last not in self.payloads:
                self._changed.clear()
                await self._changed.wait()


class Presence:
    """Present tokens, awaitable."""

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._changed = asyncio.Event()

    def note(self, key: str, present: bool) -> None:
        (self._names.add if present else self._names.discard)(key)
        self._changed.set()

    async def until(self, *keys: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while self._names != set(keys):
                self._changed.clear()
                await self._changed.wait()


def addresses(count: int) -> list[str]:
    return [f"tcp/127.0.0.1:{free_port()}" for _ in range(count)]


@pytest.fixture
def closing() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@asynccontextmanager
async def router_process(listen: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run a router in a process of its own."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", _ROUTER, listen, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    assert process.stdout is not None
    async with asyncio.timeout(PATIENCE):
        assert (await process.stdout.readline()).strip() == b"listening"
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def test_a_message_arrives_once_at_each_router(closing: ExitStack) -> None:
    listens = addresses(2)
    clients = ZenohSettings(connect=listens)
    received, present = [Received(), Received()], Presence()
    for number, listen in enumerate(listens):
        router = Bus.router(ZenohSettings(listen=listen, connect=listens))
        closing.callback(router.close)
        router.subscribe("camera/**", received[number].put)
        router.declare_alive(f"service/{number}")
    camera, other = Bus.client(clients), Bus.client(clients)
    for bus in (camera, other):
        closing.callback(bus.close)
    other.subscribe("camera/**", received[0].put)  # hears no other camera, through any router
    camera.watch_alive("service/*", present.note)
    await present.until("service/0", "service/1")
    sent = [b"%d" % number for number in range(50)]
    for payload in sent:
        camera.publish("camera/c0/video", payload)
    for each in received:
        await each.until(sent[-1])
        assert each.payloads == sent


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
async def test_a_router_that_dies_or_freezes_holds_up_no_message_to_the_others(
    closing: ExitStack, how: signal.Signals
) -> None:
    listens = addresses(2)
    received, present = Received(), Presence()
    router = Bus.router(ZenohSettings(listen=listens[0]))
    closing.callback(router.close)
    router.subscribe("camera/**", received.put)
    router.declare_alive("service/first")
    async with router_process(listens[1]) as second:
        camera = Bus.client(ZenohSettings(connect=listens))
        closing.callback(camera.close)
        camera.watch_alive("service/*", present.note)
        await present.until("service/first", "service/second")
        os.kill(second.pid, how)
        sent = [b"%d" % number + bytes(30_000) for number in range(50)]
        for payload in sent:
            camera.publish("camera/c0/video", payload)
            await asyncio.sleep(0.01)
        await received.until(sent[-1])
        assert received.payloads == sent
        await present.until("service/first")
        if how is signal.SIGSTOP:
            os.kill(second.pid, signal.SIGCONT)
            await present.until("service/first", "service/second")
    if how is signal.SIGKILL:
        async with router_process(listens[1]):
            await present.until("service/first", "service/second")


@pytest.mark.parametrize(
    ("written", "routers"),
    [
        ("tcp/a:1", ("tcp/a:1",)),
        (["tcp/a:1", "tls/b:2"], ("tcp/a:1", "tls/b:2")),
        ("tcp/a:1,tls/b:2", ("tcp/a:1", "tls/b:2")),
    ],
)
def test_routers_are_listed_in_yaml_or_with_commas(written: object, routers: tuple[str, ...]) -> None:
    assert ZenohSettings.model_validate({"connect": written}).routers == routers
