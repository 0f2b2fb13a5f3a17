"""An untrusted server: the client limits what it reads, and reports errors in one line."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

import pytest
from aiohttp import web
from aiohttp.test_utils import TestServer

import client
from client.fmp4 import MAX_BOX, BoxReader, Mp4Reader
from client.media_stream import MediaStreamError
from client.sse_parser import OverlongEventError, SseParser
from client.webm import MAX_ELEMENT, WebmReader
from fakes.http.scripted_server import OBJECTS, box, fragment, header
from fakes.timeouts import PATIENCE

PIECE = bytes(1 << 16)
ONCE = client.HttpSettings(stream_retries=0)
HASTY = client.HttpSettings(stream_retries=0, answer_timeout=0.2)
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@asynccontextmanager
async def serve_handler(handler: Handler, path: str = "/{rest:.*}") -> AsyncIterator[str]:
    app = web.Application()
    app.router.add_get(path, handler)
    async with asyncio.timeout(PATIENCE), TestServer(app) as server:
        yield str(server.make_url("/"))


def endless_response(piece: bytes, status: int = 200, pause: float = 0.0) -> Handler:
    async def answer(request: web.Request) -> web.StreamResponse:
        response = web.StreamResponse(status=status)
        await response.prepare(request)
        while True:
            await response.write(piece)  # ends when the client has gone
            await asyncio.sleep(pause)

    return answer


async def ask(url: str, settings: client.HttpSettings = ONCE) -> object:
    return await client.objects(url, settings)


async def ask_status(url: str) -> object:
    return await client.status(url, ONCE)


async def ask_past(url: str) -> object:
    return [gop async for gop in client.past(url, "-10", settings=ONCE)]


async def ask_events(url: str) -> object:
    return [event async for event in client.events(url, ONCE)]


@pytest.mark.parametrize(
    ("asking", "error"),
    [
        (ask, r"the answer is larger than \d+ bytes"),
        (ask_past, r"a line of the answer is larger than \d+ bytes"),
        (ask_events, r"a line is larger than \d+ bytes"),
    ],
)
async def test_an_endless_answer_is_refused(asking: Callable[[str], Awaitable[object]], error: str) -> None:
    async with serve_handler(endless_response(PIECE)) as url:
        with pytest.raises(client.ContractError, match=error):
            await asking(url)


async def test_an_endless_error_response_is_reported_by_its_status() -> None:
    async with serve_handler(endless_response(PIECE, status=404)) as url:
        with pytest.raises(client.NotFoundError, match=r"^404 Not Found$"):
            await ask(url)


@pytest.mark.parametrize("status", [200, 503])
async def test_a_trickling_answer_times_out(status: int) -> None:
    async with serve_handler(endless_response(b" ", status, pause=0.01)) as url:
        with pytest.raises(client.AwayError, match=r"no answer$"):
            await ask(url, HASTY)


@asynccontextmanager
async def serve_bytes(say: Callable[[asyncio.StreamWriter], Awaitable[None]]) -> AsyncIterator[str]:
    """Answer one request with arbitrary bytes."""
    over = asyncio.Event()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        with suppress(ConnectionError):
            await say(writer)
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()
        over.set()

    async with asyncio.timeout(PATIENCE), await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        await over.wait()


async def test_endless_headers_are_refused() -> None:
    async def trickle(writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\n")
        while not writer.is_closing():
            writer.write(b"X: y\r\n")
            await asyncio.sleep(0.01)

    async with serve_bytes(trickle) as url:
        with pytest.raises(client.AwayError, match=r"no answer$"):
            await ask(url, HASTY)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (b'{"objects": [], "later": ' + b"[" * 100_000, "nested too deeply"),
        (json.dumps(OBJECTS).encode().replace(b"c0", b"\xff"), "does not answer like MyView"),
    ],
)
async def test_invalid_json_is_reported_in_one_line(body: bytes, error: str) -> None:
    async def answer(_: web.Request) -> web.Response:
        return web.Response(body=body)

    async with serve_handler(answer) as url:
        with pytest.raises(client.ContractError, match=error) as caught:
            await ask(url)
    assert len(str(caught.value).splitlines()) == 1


async def test_an_error_response_without_text_is_reported_by_its_status() -> None:
    async def answer(_: web.Request) -> web.Response:
        return web.Response(status=401, body=b'{"error": "\xff"}')

    async with serve_handler(answer) as url:
        with pytest.raises(client.RefusedError, match=r"^401 Unauthorized$"):
            await ask(url)


@pytest.mark.parametrize(
    "response_bytes", [b"SSH-2.0-OpenSSH\r\n\r\n", b"HTTP/1.1 200 OK\r\nX: " + b"x" * 20_000]
)
async def test_another_protocol_is_reported_in_one_line(response_bytes: bytes) -> None:
    async def say(writer: asyncio.StreamWriter) -> None:
        writer.write(response_bytes)
        await writer.drain()

    async with serve_bytes(say) as url:
        with pytest.raises(client.AwayError) as caught:
            await ask(url)
    assert str(caught.value) == f"{url}: its answer is not valid HTTP"


async def test_too_many_redirects_are_an_error() -> None:
    async def lead(_: web.Request) -> web.Response:
        raise web.HTTPFound("/api/objects")

    async with serve_handler(lead) as url:
        with pytest.raises(client.AwayError, match=r"too many redirects$"):
            await ask(url)


async def test_a_token_is_not_sent_to_another_server_after_a_redirect() -> None:
    received: list[str | None] = []

    async def list_nobody(request: web.Request) -> web.Response:
        received.append(request.headers.get("Authorization"))
        return web.json_response({"objects": []})

    async with serve_handler(list_nobody) as other:

        async def lead(request: web.Request) -> web.Response:
            received.append(request.headers.get("Authorization"))
            raise web.HTTPFound(other + "api/objects")

        async with serve_handler(lead) as url:
            assert await client.objects(url, client.HttpSettings(token="secret")) == ()  # noqa: S106
    assert received == ["Bearer secret", None]


async def test_an_invalid_status_is_reported_in_one_line() -> None:
    async with serve_handler(endless_response(PIECE), "/api/site") as url:
        with pytest.raises(client.ContractError, match="larger than"):
            await ask_status(url)


@pytest.mark.parametrize(
    "typed",
    [
        "http://me:QXZ/JKV7@127.0.0.1:9/",
        "http://127.0.0.1:12/QXZJKV7@127.0.0.1:9/",
        "http://me:QXZ JKV7@127.0.0.1:9/",
        "http://me:QXZ#JKV7@127.0.0.1:9/",
        "http://me:QXZJKV7@127.0.0.1:9/",
        "http://127.0.0.1:99999/?token=QXZJKV7",
        "ftp://127.0.0.1:9/?token=QXZJKV7",
        "127.0.0.1:9/?token=QXZJKV7",
        "127.0.0.1:9/QXZJKV7/",
        "http://[::1/?token=QXZJKV7",
        "?token=QXZJKV7",
    ],
)
async def test_no_error_has_secrets_of_an_address(typed: str) -> None:
    for asking in (ask, ask_status, ask_past, ask_events):
        with pytest.raises((client.ClientError, ValueError)) as refused:
            await asking(typed)
        assert not any(piece in str(refused.value) for piece in ("QXZ", "JKV7")), refused.value


@pytest.mark.parametrize("asking", [ask, ask_status, ask_past, ask_events])
async def test_another_server_is_named_only_by_its_host(asking: Callable[[str], Awaitable[object]]) -> None:
    async with serve_handler(endless_response(PIECE), "/QXZJKV7/{rest:.*}") as url:
        typed = url.replace("http://", "http://me:QXZJKV7@") + "QXZJKV7/?token=QXZJKV7"
        with pytest.raises(client.ContractError, match=r"^http://127\.0\.0\.1:\d+: ") as refused:
            await asking(typed)
    assert "QXZ" not in str(refused.value)


def test_boxes_without_media_are_limited() -> None:
    reader = Mp4Reader()
    assert len(list(reader.feed(header()))) == 1
    moof, _ = BoxReader().feed(fragment(1))
    large = box(b"moof", moof.content, box(b"free", bytes(MAX_BOX // 8)))
    with pytest.raises(MediaStreamError, match="boxes without media"):
        feed_often(reader, large)


def test_elements_without_pictures_are_limited() -> None:
    size = MAX_ELEMENT // 8
    void = b"\xec" + (size | 1 << 56).to_bytes(8, "big") + bytes(size)
    with pytest.raises(MediaStreamError, match="elements without pictures"):
        feed_often(WebmReader(), void)


def feed_often(reader: Mp4Reader | WebmReader, data: bytes) -> None:
    for _ in range(10):
        assert not list(reader.feed(data))


def test_empty_lines_count_towards_the_event_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("client.sse_parser.MAX_EVENT", 1000)
    SseParser().feed(b"data:\n" * 900)
    with pytest.raises(OverlongEventError):
        SseParser().feed(b"data:\n" * 1100)


def test_a_stated_size_does_not_reserve_memory() -> None:
    with pytest.raises(MediaStreamError, match="a box of"):
        list(BoxReader().feed(struct.pack(">I4sQ", 1, b"mdat", 1 << 60)))
