"""zenoh for asyncio: any order of connecting, restarts of the router, and closing of sessions."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections import deque

import pytest
import zenoh
from pydantic import ValidationError

from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.config.sections import ZenohSettings
from server.messaging.bus import Bus
from server.messaging.inbox import Inbox, Message
from server.system.errors import UserError


@pytest.fixture
def settings() -> ZenohSettings:
    address = f"tcp/127.0.0.1:{free_port()}"
    return ZenohSettings(connect=address, listen=address)


class ReceivedItems:
    """Received items, awaitable."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[Message] = asyncio.Queue()

    async def next(self) -> Message:
        async with asyncio.timeout(PATIENCE):
            return await self.queue.get()


class Presence:
    """Present sessions, awaitable."""

    def __init__(self) -> None:
        self.names: set[str] = set()
        self._changed = asyncio.Event()

    def note(self, key: str, present: bool) -> None:
        (self.names.add if present else self.names.discard)(key)
        self._changed.set()

    async def until(self, *keys: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while self.names != set(keys):
                await self._changed.wait()
                self._changed.clear()


async def test_a_message_arrives_with_its_key_and_attachment(settings: ZenohSettings) -> None:
    router, client = Bus.router(settings), Bus.client(settings)
    received, present = ReceivedItems(), Presence()
    router.subscribe("myview/hall/*/video", received.queue.put_nowait)
    client.watch_alive("myview/hall/bestview", present.note)
    router.declare_alive("myview/hall/bestview")
    await present.until("myview/hall/bestview")
    client.publish("myview/hall/c0/video", b"picture", b"head")
    assert await received.next() == Message("myview/hall/c0/video", b"picture", b"head")
    client.publish("myview/hall/c0/video", b"picture")
    assert (await received.next()).attachment == b""
    client.close()
    router.close()


async def test_an_oversized_message_is_dropped_and_others_arrive(settings: ZenohSettings) -> None:
    router, client = Bus.router(settings), Bus.client(settings)
    received, present = ReceivedItems(), Presence()
    router.subscribe("myview/hall/camera/*/video", received.queue.put_nowait)
    client.watch_alive("router", present.note)
    router.declare_alive("router")
    await present.until("router")
    key, wait = "myview/hall/camera/c0/video", zenoh.CongestionControl.BLOCK  # the sender may block
    for payload in (bytes(40_000_000), b"picture"):
        await asyncio.to_thread(client._session.put, key, payload, congestion_control=wait)
    assert (await received.next()).payload == b"picture"
    client.close()
    router.close()


async def test_messages_of_one_session_stay_in_order(settings: ZenohSettings) -> None:
    router, client = Bus.router(settings), Bus.client(settings)
    received, present = ReceivedItems(), Presence()
    router.subscribe("a/**", received.queue.put_nowait)
    client.watch_alive("router", present.note)
    router.declare_alive("router")
    await present.until("router")
    for number in range(200):
        client.publish(f"a/{'bc'[number % 2]}", str(number).encode() + bytes(1000 * (number % 7)))
        await asyncio.sleep(0)
    got = [int((await received.next()).payload.split(b"\0")[0]) for _ in range(200)]
    assert got == list(range(200))
    client.close()
    router.close()


async def test_publishers_are_bounded_and_all_messages_arrive(
    settings: ZenohSettings,
) -> None:
    router, client = Bus.router(settings), Bus.client(settings)
    received, present = ReceivedItems(), Presence()
    router.subscribe("thumbs/**", received.queue.put_nowait)
    client.watch_alive("router", present.note)
    router.declare_alive("router")
    await present.until("router")
    keys = [f"thumbs/{number}" for number in range(200)]
    for key in keys:
        client.publish(key, b"jpeg")
        client.publish("thumbs/often", b"jpeg")
        await asyncio.sleep(0)
    got = [(await received.next()).key for _ in range(400)]
    assert [key for key in got if key != "thumbs/often"] == keys
    assert len(client._publishers) <= 64
    assert list(client._publishers)[-2:] == ["thumbs/199", "thumbs/often"]
    client.close()
    router.close()


async def test_a_client_may_start_before_the_router_and_survives_its_restart(settings: ZenohSettings) -> None:
    client = Bus.client(settings)
    present = Presence()
    client.watch_alive("router", present.note)
    client.declare_alive("client")
    for _ in range(2):
        router = Bus.router(settings)
        received, clients = ReceivedItems(), Presence()
        router.subscribe("word", received.queue.put_nowait)
        router.watch_alive("client", clients.note)
        router.declare_alive("router")
        await present.until("router")
        await clients.until("client")
        client.publish("word", b"hello")
        assert (await received.next()).payload == b"hello"
        router.close()
        await present.until()
    client.close()


async def test_two_clients_exchange_messages_through_the_router_until_one_unsubscribes(
    settings: ZenohSettings,
) -> None:
    router = Bus.router(settings)
    one, two = Bus.peer_listener(settings), Bus.peer_listener(settings)
    received, second_received, present = ReceivedItems(), ReceivedItems(), Presence()
    two.subscribe("found/*", received.queue.put_nowait)
    end = two.subscribe_temporarily("found/one", second_received.queue.put_nowait)
    one.watch_alive("ready", present.note)
    two.declare_alive("ready")
    await present.until("ready")
    one.publish("found/one", b"first")
    assert (await second_received.next()).payload == b"first"
    end()
    end()
    one.publish("found/one", b"second")
    assert [(await received.next()).payload for _ in range(2)] == [b"first", b"second"]
    assert second_received.queue.empty()
    for bus in (one, two, router):
        bus.close()


async def test_a_listener_session_needs_the_router(
    settings: ZenohSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.messaging.bus._OPEN_WITHIN_MS", 100)
    with pytest.raises(UserError, match=r"zenoh\.connect: no router responds at tcp/127"):
        Bus.peer_listener(settings)


async def test_liveliness_tokens_of_present_and_closed_sessions_are_reported(
    settings: ZenohSettings,
) -> None:
    router, client = Bus.router(settings), Bus.client(settings)
    client.declare_alive("camera/c0")
    first = Presence()
    router.watch_alive("camera/*", first.note)
    await first.until("camera/c0")
    late = Presence()
    router.watch_alive("camera/*", late.note)
    await late.until("camera/c0")
    client.close()
    await first.until()
    router.close()


async def test_two_routers_cannot_share_an_address(settings: ZenohSettings) -> None:
    router = Bus.router(settings)
    with pytest.raises(UserError, match=r"zenoh\.listen: cannot listen on tcp/127") as caught:
        Bus.router(settings)
    assert "\n" not in str(caught.value)
    router.close()


async def test_an_invalid_address_is_refused() -> None:
    for address in ("nonsense", "tcp/127.0.0.1", "127.0.0.1:7447", "tcp/a b:1", "tcp/a:65536", "tcp/a:0"):
        with pytest.raises(ValidationError, match="is not an address such as tcp"):
            ZenohSettings(connect=address)
    with pytest.raises(UserError, match=r"zenoh\.connect: cannot use smoke/signal:1") as caught:
        Bus.client(ZenohSettings(connect="smoke/signal:1"))
    assert "\n" not in str(caught.value)


SCRIPT = """
import asyncio
from server.messaging.bus import Bus
from server.config.sections import ZenohSettings
async def main():
    address = "tcp/127.0.0.1:{port}"
    settings = ZenohSettings(connect=address, listen=address)
    buses = [Bus.router(settings), Bus.client(settings)]
    for bus in buses:
        bus.subscribe("a", print)
        bus.watch_alive("b", print)
        bus.declare_alive("b")
        bus.publish("a", b"x")
    for bus in reversed(buses):
        bus.close()
asyncio.run(main())
"""


def test_a_process_that_closes_its_sessions_exits() -> None:
    completed = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(port=free_port())], timeout=PATIENCE, check=False
    )
    assert completed.returncode == 0


async def test_items_from_threads_are_handled_on_the_loop_in_order() -> None:
    got: list[tuple[int, int]] = []
    completed = asyncio.Event()

    def handle(number: int) -> None:
        got.append((number, threading.get_ident()))
        if number == 999:
            completed.set()

    inbox = Inbox(handle)
    thread = threading.Thread(target=lambda: deque(map(inbox.put, range(1000)), maxlen=0))
    thread.start()
    async with asyncio.timeout(PATIENCE):
        await completed.wait()
    thread.join()
    assert got == [(number, threading.get_ident()) for number in range(1000)]


async def test_other_tasks_run_between_slices_and_the_order_is_kept() -> None:
    got: list[int] = []
    inbox = Inbox(got.append, turn_s=0.0)
    for number in range(20):
        inbox.put(number)
    seen = []
    while inbox.waiting:
        await asyncio.sleep(0)
        seen.append(len(got))
    assert got == list(range(20))
    assert seen == list(range(1, 21))


async def test_an_endless_flood_does_not_block_the_loop() -> None:
    """Each item is followed by another before it is handled: there is always one more."""
    most = 5_000_000  # some seconds of them
    inbox: Inbox[int] = Inbox(lambda left: inbox.put(left - 1) if left else None)
    inbox.put(most)
    async with asyncio.timeout(PATIENCE):
        for _ in range(10):
            await asyncio.sleep(0)
    assert inbox.waiting


async def test_a_busy_loop_drops_the_oldest_items_and_counts_them() -> None:
    got: list[int] = []
    inbox = Inbox(got.append, pending_max=10, turn_s=PATIENCE)
    for number in range(25):
        inbox.put(number)
    await asyncio.sleep(0)
    assert got == list(range(15, 25))
    assert inbox.lost == 15


async def test_a_flooding_sender_takes_neither_space_nor_turns_from_others() -> None:
    got: list[str] = []
    inbox = Inbox(got.append, pending_max=10, turn_s=PATIENCE, sender_of=lambda text: text[:2])
    for number in range(1000):
        inbox.put(f"c0 {number}")
        if number < 5:
            inbox.put(f"c1 {number}")
    await asyncio.sleep(0)
    assert [text for text in got if text.startswith("c1")] == [f"c1 {number}" for number in range(5)]
    assert [text for text in got if text.startswith("c0")] == [f"c0 {number}" for number in range(990, 1000)]
    assert got[:4] == ["c0 990", "c1 0", "c0 991", "c1 1"]
    assert (inbox.lost, inbox.waiting) == (990, 0)


async def test_waiting_bytes_of_one_sender_are_limited() -> None:
    got: list[bytes] = []
    inbox = Inbox(got.append, turn_s=PATIENCE, size=lambda _: 1 << 24)
    for number in range(10):
        inbox.put(b"%d" % number)
    await asyncio.sleep(0)
    assert got == [b"6", b"7", b"8", b"9"]
    assert inbox.lost == 6


async def test_the_number_of_sender_queues_is_limited() -> None:
    got: list[int] = []
    inbox = Inbox(got.append, pending_max=10, sender_of=str)
    for number in range(5000):
        inbox.put(number)
    assert inbox.waiting <= 1024 + 10
    while inbox.waiting:  # noqa: ASYNC110
        await asyncio.sleep(0)
    assert got[:3] == [0, 1, 2]


async def test_an_item_that_raises_does_not_block_others(caplog: pytest.LogCaptureFixture) -> None:
    got: list[float] = []
    inbox: Inbox[int] = Inbox(lambda number: got.append(1 / number), turn_s=PATIENCE)
    for number in (1, 0, 2, *[0] * 20):
        inbox.put(number)
    await asyncio.sleep(0)
    assert got == [1.0, 0.5]
    assert "ZeroDivisionError" in caplog.text
    assert len(caplog.messages) == 1, "repeated errors are one log line"
