"""The bus with users and encryption: unknown clients are excluded; a camera cannot impersonate another."""

from __future__ import annotations

import asyncio
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest

from fakes.paths import DOCS
from fakes.programs import needs_openssl
from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.config.password_file import password_of, read_users
from server.config.sections import LinkSettings, ProcessTlsSettings, ZenohSettings, site_user
from server.messaging.bus import Bus
from server.messaging.bus_access import SETTING, build_access_control
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys
from server.system.errors import UserError

pytestmark = needs_openssl

SITE = ZenohKeys("hall")
SECURITY = (DOCS / "how-to" / "secure.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make certificates with the commands of docs/how-to/secure.md."""
    folder = tmp_path_factory.mktemp("bus")
    found = re.search(r"```sh\n(openssl.*?)```", SECURITY, re.DOTALL)
    assert found
    lines = found[1].replace("10.0.0.5", "127.0.0.1")
    subprocess.run(["bash", "-e", "-c", lines], cwd=folder, check=True, capture_output=True)
    (folder / "zenoh.users").write_text("c0:zero\nc1:one\nbestview-1:other\nauditor:ear\n", encoding="utf-8")
    return folder


@pytest.fixture
def settings(folder: Path) -> ZenohSettings:
    address = f"tls/127.0.0.1:{free_port()}"
    tls = ProcessTlsSettings(
        authority=folder / "authority.pem", certificate=folder / "router.pem", key=folder / "router.key"
    )
    return ZenohSettings(connect=address, listen=address, users=folder / "zenoh.users", tls=tls)


class ReceivedTexts:
    """Received texts, awaitable."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._new = asyncio.Event()

    def __call__(self, message: Message) -> None:
        self.texts.append(f"{message.key.rpartition('camera/')[2]} {message.payload.decode()}")
        self._new.set()

    async def until(self, text: str, send: Callable[[], None]) -> None:
        """Wait for a text, sending it repeatedly: without a subscriber it is lost."""
        async with asyncio.timeout(PATIENCE):
            while text not in self.texts:
                self._new.clear()
                send()
                try:
                    async with asyncio.timeout(0.05):
                        await self._new.wait()
                except TimeoutError:
                    continue


@contextmanager
def open_sessions(*openings: Callable[[], Bus]) -> Iterator[list[Bus]]:
    """Open sessions, and close them all."""
    with ExitStack() as stack:
        buses = []
        for opening in openings:
            bus = opening()
            stack.callback(bus.close)
            buses.append(bus)
        yield buses


def router(settings: ZenohSettings) -> Bus:
    assert settings.users is not None
    return Bus.router(
        settings, build_access_control("hall", ["c0", "c1"], "c1", list(read_users(settings.users, SETTING)))
    )


async def test_a_camera_publishes_under_its_own_key_only(settings: ZenohSettings) -> None:
    received = ReceivedTexts()
    with open_sessions(
        lambda: router(settings), lambda: Bus.client(settings, "c0"), lambda: Bus.client(settings, "c1")
    ) as (bestview, c0, c1):
        bestview.subscribe(SITE.camera("*", "video"), received)
        await received.until("c0/video own", lambda: c0.publish(SITE.camera("c0", "video"), b"own"))

        def false_and_true() -> None:
            c1.publish(SITE.camera("c0", "video"), b"false")
            c1.publish(SITE.camera("c1", "video"), b"true")

        await received.until("c1/video true", false_and_true)
        assert "c0/video false" not in received.texts, (
            "a session keeps its order: it would have arrived before"
        )


async def test_a_camera_receives_detections_of_others_and_nothing_else_of_them_or_the_service(
    settings: ZenohSettings,
) -> None:
    received, alive, peers = ReceivedTexts(), asyncio.Event(), asyncio.Event()
    with open_sessions(
        lambda: router(settings),
        lambda: Bus.peer_listener(settings, "c0"),
        lambda: Bus.client(settings, "c1"),
    ) as (bestview, c0, c1):
        for key in ("**", SITE.bestview("choices"), SITE.sound, SITE.camera("c1", "video")):
            c0.subscribe(key, received)
        c0.subscribe(SITE.camera("*", "detections"), received)
        c0.watch_alive(SITE.bestview("**"), lambda *_: alive.set())
        c0.watch_alive(SITE.camera("*", "peer_listener"), lambda *_: peers.set())
        bestview.declare_alive(SITE.bestview("alive"))
        c1.declare_alive(SITE.camera("c1", "peer_listener"))

        def send_all() -> None:
            bestview.publish(SITE.bestview("choices"), b"choices")
            bestview.publish(SITE.sound, b"sound")
            for topic in ("video", "tracks", "status", "detections"):
                c1.publish(SITE.camera("c1", topic), topic.encode())

        for _ in range(10):  # time enough for everything to arrive
            received.texts.clear()
            await received.until("c1/detections detections", send_all)
        assert set(received.texts) == {"c1/detections detections"}
        async with asyncio.timeout(PATIENCE):
            await asyncio.gather(alive.wait(), peers.wait())


async def test_audio_is_published_by_the_audio_camera_only(settings: ZenohSettings) -> None:
    received = ReceivedTexts()
    with open_sessions(
        lambda: router(settings), lambda: Bus.client(settings, "c0"), lambda: Bus.client(settings, "c1")
    ) as (bestview, c0, c1):
        bestview.subscribe(SITE.sound, received)
        bestview.subscribe(SITE.camera("*", "status"), received)
        await received.until(f"{SITE.sound} c1", lambda: c1.publish(SITE.sound, b"c1"))

        def audio_and_status() -> None:
            c0.publish(SITE.sound, b"c0")
            c0.publish(SITE.camera("c0", "status"), b"after")

        await received.until("c0/status after", audio_and_status)
        assert f"{SITE.sound} c0" not in received.texts


async def test_clients_without_a_user_can_neither_publish_nor_subscribe(
    settings: ZenohSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.messaging.bus._OPEN_WITHIN_MS", 300)
    strangers = [
        settings.model_copy(update={"users": None}),
        settings.model_copy(update={"users": _users(tmp_path, "c0:guessed\n")}),
        settings.model_copy(update={"connect": settings.connect.replace("tls/", "tcp/")}),
        settings.model_copy(update={"tls": ProcessTlsSettings()}),
    ]
    received, received_by_other = ReceivedTexts(), ReceivedTexts()
    with open_sessions(
        lambda: router(settings),
        lambda: Bus.client(settings, "c1"),
        *(partial(Bus.client, stranger, "c0") for stranger in strangers),
    ) as (bestview, c1, *unknown_clients):
        bestview.subscribe(SITE.camera("*", "*"), received)
        alive: list[str] = []
        is_known = asyncio.Event()

        def note(key: str, _: bool) -> None:
            alive.append(key)
            if key == SITE.camera("c1", "alive"):
                is_known.set()

        bestview.watch_alive(SITE.camera("*", "alive"), note)
        for client in unknown_clients:
            client.subscribe("**", received_by_other)
            client.declare_alive(SITE.camera("c0", "alive"))
        c1.declare_alive(SITE.camera("c1", "alive"))
        for number in range(10):  # time enough to be admitted
            await received.until(
                f"c1/video {number}", partial(_publish_from_all, [*unknown_clients, c1], number)
            )
        assert not [text for text in received.texts if text.startswith("c0")]
        await is_known.wait()
        assert alive == [SITE.camera("c1", "alive")]
        assert not [
            text for text in received_by_other.texts if text.startswith("c1")
        ]  # they receive their own
        for stranger in strangers:
            with pytest.raises(UserError, match=r"zenoh\.connect: no router responds at"):
                await asyncio.to_thread(Bus.peer_listener, stranger, "c0")


def _publish_from_all(buses: Sequence[Bus], number: int) -> None:
    *unknown_clients, c1 = buses
    for client in unknown_clients:
        client.publish(SITE.camera("c0", "video"), b"false")
    c1.publish(SITE.camera("c1", "video"), str(number).encode())


@pytest.mark.parametrize("topic", ["position_corrections", "identities", "end_received"])
async def test_camera_commands_come_from_the_service_and_reach_that_camera_only(
    settings: ZenohSettings, topic: str
) -> None:
    received, received_by_other = ReceivedTexts(), ReceivedTexts()
    with open_sessions(
        lambda: router(settings),
        lambda: Bus.client(settings, "c0"),
        lambda: Bus.client(settings, "c1"),
        lambda: Bus.peer_listener(settings, "auditor"),
    ) as (bestview, c0, c1, auditor):
        c0.subscribe(SITE.camera("c0", topic), received)
        c1.subscribe(SITE.camera("c0", topic), received_by_other)
        c1.subscribe(SITE.camera("c1", topic), received_by_other)

        def send_all() -> None:
            c1.publish(SITE.camera("c0", topic), b"false")
            auditor.publish(SITE.camera("c0", topic), b"false")
            bestview.publish(SITE.camera("c0", topic), b"there")
            bestview.publish(SITE.camera("c1", topic), b"here")

        await received.until(f"c0/{topic} there", send_all)
        await received_by_other.until(f"c1/{topic} here", send_all)
        for number in range(5):  # time enough for it to arrive
            await received.until(f"c0/{topic} {number}", partial(_send_commands, bestview, c1, topic, number))
        assert f"c0/{topic} false" not in received.texts
        assert set(received_by_other.texts) - {f"c0/{topic} false"} == {f"c1/{topic} here"}, "except its own"


def _send_commands(bestview: Bus, other: Bus, topic: str, number: int) -> None:
    other.publish(SITE.camera("c0", topic), b"false")
    bestview.publish(SITE.camera("c0", topic), str(number).encode())


async def test_cameras_receive_peers_detections_but_not_their_video(settings: ZenohSettings) -> None:
    received = ReceivedTexts()
    with open_sessions(
        lambda: router(settings),
        lambda: Bus.client(settings, "c0"),
        lambda: Bus.peer_listener(settings, "c1"),
        lambda: Bus.peer_listener(settings, "auditor"),
    ) as (_, c0, c1, auditor):
        for key in (SITE.camera("c0", "*"), SITE.camera("c0", "detections"), SITE.camera("c1", "detections")):
            c1.subscribe(key, received)
        received_all = ReceivedTexts()
        auditor.subscribe(SITE.camera("c0", "*"), received_all)

        def send_all() -> None:
            c0.publish(SITE.camera("c0", "video"), b"seen")
            auditor.publish(SITE.camera("c1", "detections"), b"false")
            c0.publish(SITE.camera("c0", "detections"), b"detections")

        await received.until("c0/detections detections", send_all)
        await received_all.until("c0/video seen", send_all)  # it may arrive within a round
        await received_all.until("c0/detections detections", send_all)
        assert set(received.texts) == {"c0/detections detections"}
        assert set(received_all.texts) == {"c0/video seen", "c0/detections detections"}, (
            "a subscriber sends nothing"
        )


async def test_another_service_exchanges_messages_with_the_router(settings: ZenohSettings) -> None:
    received, sent = ReceivedTexts(), ReceivedTexts()
    with open_sessions(lambda: router(settings), lambda: Bus.client(settings, "bestview-1")) as (
        first,
        second,
    ):
        first.subscribe(SITE.bestview("record", 1), received)
        second.subscribe(SITE.bestview("record"), sent)
        of_first, of_second = SITE.bestview("record"), SITE.bestview("record", 1)
        await received.until(f"{of_second} here", lambda: second.publish(of_second, b"here"))
        await sent.until(f"{of_first} there", lambda: first.publish(of_first, b"there"))


def _users(folder: Path, text: str) -> Path:
    path = folder / "users"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("text", ["c0\n", "c0:\n", ":p\n", " c0:a\n", "c0:a\n\nc1:b\n"])
def test_an_invalid_password_file_is_reported_in_one_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(UserError, match=r"zenoh\.users: .*: line \d is not name:password"):
        read_users(_users(tmp_path, text), SETTING)


def test_a_user_with_two_lines_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"zenoh\.users: .*: lines 1 and 3 are for the same name") as refused:
        read_users(_users(tmp_path, "c0:secret-1\nc1:b\nc0:secret-2\n"), SETTING)
    assert "secret" not in str(refused.value)


def test_a_missing_user_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="has no line for 'c1', the name of this process"):
        password_of(_users(tmp_path, "c0:a\n"), "c1", SETTING)
    with pytest.raises(UserError, match=r"zenoh\.users: cannot read .*none"):
        password_of(tmp_path / "none", "c0", SETTING)


async def test_another_site_receives_what_it_is_told_about_people_and_nothing_else(
    settings: ZenohSettings, folder: Path, tmp_path: Path
) -> None:
    users = _users(tmp_path, (folder / "zenoh.users").read_text(encoding="utf-8") + "site-yard:far\n")
    (tmp_path / "yard").mkdir()
    at_hall = settings.model_copy(update={"users": users})
    link = LinkSettings(
        connect=settings.connect,
        url="http://hall/",
        users=_users(tmp_path / "yard", "site-yard:far\n"),
        authority=settings.tls.authority,
    )
    received, at_service = ReceivedTexts(), ReceivedTexts()
    with open_sessions(
        lambda: router(at_hall),
        lambda: Bus.client(settings, "c0"),
        lambda: Bus.client(link.bus(1.0), site_user("yard")),
    ) as (bestview, c0, yard):
        for key in ("**", SITE.camera("*", "*"), SITE.bestview("**"), SITE.bestview("**/people")):
            yard.subscribe(key, received)
        bestview.subscribe(SITE.bestview("**/people"), at_service)
        bestview.subscribe(SITE.camera("*", "video"), at_service)

        def send_all() -> None:
            yard.publish(SITE.bestview("people"), b"false")
            yard.publish(SITE.camera("c0", "video"), b"false")
            c0.publish(SITE.camera("c0", "video"), b"video")
            for topic in ("choices", "record", "people"):
                bestview.publish(SITE.bestview(topic), topic.encode())

        for _ in range(10):  # time enough for everything to arrive
            received.texts.clear()
            await received.until(f"{SITE.bestview('people')} people", send_all)
        await at_service.until("c0/video video", send_all)
        assert set(received.texts) - {f"{SITE.bestview('people')} false", "c0/video false"} == {
            f"{SITE.bestview('people')} people"
        }, "except its own"
        assert not [text for text in at_service.texts if "false" in text]
