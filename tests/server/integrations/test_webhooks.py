"""Webhooks are signed by Standard Webhooks, tried again until taken, bounded, and keep their secrets."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import pytest
from aiohttp import web

from fakes.timeouts import PATIENCE
from server.config.sections import WebhookSettings
from server.integrations.secret_files import read_webhook_key
from server.integrations.webhooks import Webhook, sign
from server.service.facade.rules import EventRecord, PicturedEvent
from server.system.errors import UserError

SECRET = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"  # noqa: S105 — of the scheme's own example
SOON = 0.01


def event(number: int = 1, rule: str = "in", jpeg: bytes | None = b"\xff\xd8") -> PicturedEvent:
    record = EventRecord(
        rule=rule,
        kind="entered",
        phase="once",
        zone="till",
        objects=[3],
        names=["Ann"],
        direction=None,
        pulse=100,
        time="2026-11-26T17:00:00.000Z",
        confirmed=110,
        camera="c0",
        id=f"19abc-110-{number}",
        picture=None if jpeg is None else f"api/events/19abc-110-{number}/picture.jpg",
        clip="objects/3/best.mp4?from=p25&to=p275",
    )
    return PicturedEvent(record, jpeg)


@dataclass(slots=True)
class Receiver:
    """The other side: keeps what it gets, and answers as a test says."""

    url: str = ""
    answer: Callable[[int], web.Response] = field(default=lambda _: web.Response())
    bodies: list[bytes] = field(default_factory=list)
    heads: list[dict[str, str]] = field(default_factory=list)
    received: asyncio.Condition = field(default_factory=asyncio.Condition)

    async def until(self, count: int) -> None:
        async with asyncio.timeout(PATIENCE), self.received:
            await self.received.wait_for(lambda: len(self.bodies) >= count)

    async def handle(self, request: web.Request) -> web.Response:
        async with self.received:
            self.bodies.append(await request.read())
            self.heads.append(dict(request.headers))
            self.received.notify_all()
        return self.answer(len(self.bodies))


@pytest.fixture
async def receiver() -> AsyncIterator[Receiver]:
    found = Receiver()
    app = web.Application()
    app.router.add_post("/hook", found.handle)
    runner = web.AppRunner(app)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    assert site._server is not None
    port = site._server.sockets[0].getsockname()[1]  # type: ignore[attr-defined]
    found.url = f"http://127.0.0.1:{port}/hook?key=hidden"
    yield found
    await runner.cleanup()


@asynccontextmanager
async def posting(settings: WebhookSettings, url: str | None = None) -> AsyncIterator[Webhook]:
    webhook = Webhook(settings, url, first_s=SOON)
    task = asyncio.create_task(webhook.run())
    try:
        yield webhook
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def secret_file(folder: Path, text: str = SECRET) -> Path:
    path = folder / "secret"
    path.write_text(f"{text}\n", encoding="utf-8")
    return path


def test_the_signature_is_that_of_the_standard(tmp_path: Path) -> None:
    """The example of the specification."""
    key = read_webhook_key(secret_file(tmp_path), "webhooks: secret")
    signature = sign(key, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}')
    assert signature == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


async def test_an_event_is_posted_signed_with_its_picture(receiver: Receiver, tmp_path: Path) -> None:
    settings = WebhookSettings(url=receiver.url, secret=secret_file(tmp_path))
    async with posting(settings, "https://hall.example/") as webhook:
        webhook.put_event(event())
        await receiver.until(1)
    (body,), (head,) = receiver.bodies, receiver.heads
    content = json.loads(body)
    assert (content["type"], content["timestamp"]) == ("rule.entered", "2026-11-26T17:00:00.000Z")
    data = content["data"]
    assert (data["rule"], data["zone"], data["objects"], data["names"]) == ("in", "till", [3], ["Ann"])
    assert data["clip"] == "https://hall.example/objects/3/best.mp4?from=p25&to=p275"
    assert data["picture"] == "https://hall.example/api/events/19abc-110-1/picture.jpg"
    assert data["picture_data"] == "data:image/jpeg;base64," + base64.b64encode(b"\xff\xd8").decode()
    assert head["webhook-id"] == "19abc-110-1"
    key = read_webhook_key(secret_file(tmp_path), "")
    expected = sign(key, head["webhook-id"], int(head["webhook-timestamp"]), body)
    assert head["webhook-signature"] == expected


async def test_an_event_is_posted_again_until_it_is_taken_and_keeps_its_id(receiver: Receiver) -> None:
    receiver.answer = lambda count: web.Response(status=503 if count < 4 else 204)
    async with posting(WebhookSettings(url=receiver.url, pictures=False)) as webhook:
        webhook.put_event(event(1))
        webhook.put_event(event(2))
        await receiver.until(5)
    ids = [head["webhook-id"].rpartition("-")[2] for head in receiver.heads]
    assert ids == ["1", "1", "1", "1", "2"], "in their order"
    assert "webhook-signature" not in receiver.heads[0]
    assert "picture_data" not in json.loads(receiver.bodies[0])["data"]


async def test_an_event_is_given_up_after_some_attempts(
    receiver: Receiver, caplog: pytest.LogCaptureFixture
) -> None:
    receiver.answer = lambda count: web.Response(status=500 if count <= 8 else 200)
    async with posting(WebhookSettings(url=receiver.url)) as webhook:
        webhook.put_event(event(1))
        webhook.put_event(event(2))
        await receiver.until(9)
    assert receiver.heads[8]["webhook-id"].endswith("-2")
    assert "event 19abc-110-1 was not taken, and is given up" in caplog.text


async def test_redirects_are_not_followed(receiver: Receiver) -> None:
    receiver.answer = lambda count: (
        web.Response(status=307, headers={"Location": receiver.url}) if count == 1 else web.Response()
    )
    async with posting(WebhookSettings(url=receiver.url)) as webhook:
        webhook.put_event(event())
        await receiver.until(2)
    assert {head["webhook-id"] for head in receiver.heads} == {"19abc-110-1"}


async def test_only_events_of_its_rules_are_posted(receiver: Receiver) -> None:
    async with posting(WebhookSettings(url=receiver.url, rules=["queue"])) as webhook:
        webhook.put_event(event(1, "in"))
        webhook.put_event(event(2, "queue"))
        await receiver.until(1)
    assert [head["webhook-id"] for head in receiver.heads] == ["19abc-110-2"]


def test_a_deleted_person_is_in_no_event_that_waits() -> None:
    webhook = Webhook(WebhookSettings(url="http://127.0.0.1:9/hook"), None)
    alone = event(1, jpeg=b"picture")
    both = msgspec.structs.replace(alone.record, objects=[3, 5], names=["Ann", None])
    webhook.put_event(alone)
    webhook.put_event(PicturedEvent(both, alone.jpeg))
    webhook.forget([4])
    assert len(webhook._waiting) == 2
    webhook.forget([3])
    (left,) = webhook._waiting
    assert (left.record.objects, left.record.names) == ([5], [None])
    assert (left.record.picture, left.record.clip, left.record.camera, left.jpeg) == (None, None, None, None)


async def test_a_deleted_person_is_in_no_event_that_is_tried_again(receiver: Receiver) -> None:
    alone = event(1)
    both = msgspec.structs.replace(alone.record, id="19abc-110-2", objects=[3, 5], names=["Ann", None])
    async with posting(WebhookSettings(url=receiver.url)) as webhook:

        def refuse_first_of_each(count: int) -> web.Response:
            if count == 2:
                webhook.put_event(PicturedEvent(both, alone.jpeg))
            if count in {1, 3}:
                webhook.forget([4] if count == 1 else [3])
            return web.Response(status=204 if count in {2, 4} else 503)

        receiver.answer = refuse_first_of_each
        webhook.put_event(alone)
        await receiver.until(4)

        def refuse(_: int) -> web.Response:
            webhook.forget([3])
            return web.Response(status=503)

        receiver.answer = refuse
        webhook.put_event(alone)
        await receiver.until(5)
        receiver.answer = lambda _: web.Response()
        left = msgspec.structs.replace(both, id="19abc-110-3", objects=[5], names=[None])
        webhook.put_event(PicturedEvent(left, None))
        await receiver.until(6)
    sent = [(json.loads(body)["data"]["objects"], b"picture_data" in body) for body in receiver.bodies]
    assert sent == [([3], True), ([3], True), ([3, 5], True), ([5], False), ([3], True), ([5], False)]


async def test_waiting_events_are_bounded_and_the_oldest_are_lost(caplog: pytest.LogCaptureFixture) -> None:
    webhook = Webhook(WebhookSettings(url="http://127.0.0.1:9/hook"), None)
    for number in range(150):
        webhook.put_event(event(number))
    assert [each.record.id for each in webhook._waiting][0] == "19abc-110-50"  # noqa: RUF015
    assert "too many events wait; the oldest are lost" in caplog.text


async def test_logs_have_neither_secret_nor_address(
    receiver: Receiver, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    refused = [True]
    receiver.answer = lambda _: (
        web.Response(status=500 if refused.pop() else 200) if refused else web.Response()
    )
    path = secret_file(tmp_path)
    closed = WebhookSettings(url="http://user:hidden@127.0.0.1:9/hidden", secret=path)
    async with posting(WebhookSettings(url=receiver.url, secret=path)) as one, posting(closed) as other:
        one.put_event(event(1))
        other.put_event(event(2))
        await receiver.until(2)
        async with asyncio.timeout(PATIENCE):
            while "given up" not in caplog.text:  # noqa: ASYNC110 — a log has no event
                await asyncio.sleep(SOON)
    written = "\n".join(record.getMessage() for record in caplog.records if record.name.startswith("server"))
    assert "webhook http://127.0.0.1" in written
    assert "hidden" not in written
    assert SECRET not in written


@pytest.mark.parametrize(
    "text", ["whsec_", "whsec_!!", "MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "whsec_c2hvcnQ=", ""]
)
def test_other_keys_are_refused_without_being_repeated(tmp_path: Path, text: str) -> None:
    with pytest.raises(UserError) as caught:
        read_webhook_key(secret_file(tmp_path, text), "webhooks: secret")
    assert text == "" or text not in str(caught.value).replace("whsec_ and", "")


def test_a_missing_secret_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(
        UserError, match=r"^webhooks: secret: the file cannot be read: No such file or directory$"
    ):
        read_webhook_key(tmp_path / "none", "webhooks: secret")
