"""The served application: addresses, parameters and bodies by its own description, and raw bytes."""

from __future__ import annotations

import asyncio
import contextlib
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from urllib.parse import quote

from benchmarks.fuzz_mutate import as_json, damaged, odd, otherwise
from benchmarks.fuzz_site import (
    CAMERAS,
    STRIDE,
    Fed,
    pictures,
    site,
    sound,
    status,
    thumbnail,
    tracks,
    video,
    word,
)
from benchmarks.fuzz_target import Target
from server.web.app import make_app, serving
from server.web.openapi import describe
from server.web.operator_permission import CHANGES
from server.wire.epochs import end_of_epoch

WORDS = (
    b"\r\n", b"\n", b"\r", b"\x00", b"\xff", b" ", b"%", b"%00", b"%2e%2e%2f", b"../", b"/..//", b"%ff",
    b"%ud800", b"?", b"&", b"=", b"#", b";", b":", b"\xc3\xa9", b"Content-Length: 9999999\r\n",
    b"Content-Length: -1\r\n", b"Transfer-Encoding: chunked\r\n", b"ffffffffffffffff\r\n",
    b"Expect: 100-continue\r\n", b"Range: bytes=9-1\r\n", b"HTTP/9.9", b"HTTP/1.0", b"CONNECT ",
    b"A" * 9000, b"0" * 5000, b"Cookie: a=b; =\x01\r\n", b"Host: \r\n",
)  # fmt: skip
_CHANGES_SHARE = 0.8
_EPOCHS = 6
_WAIT_S = 0.03
"""Then an answer is not waited for: a playlist waits until what it was asked for is there."""
_MOMENTS = (
    "-60", "p5", "p0", "p9999999999999", "-0", "-999999999", "2026-11-21T16:13:36Z",
    "0001-01-01T00:00:00+23:59", "9999-12-31T23:59:59-23:59", "2026-11-21", "now", "-1e9", "p-1", "",
)  # fmt: skip
_METHODS = ("GET",) * 12 + ("HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "get", "X")
_BODIES = (
    {"object": 1, "name": "Ada"},
    {"object": 1, "merge": 2},
    {"object": 1, "part": ["c0"]},
    {"switch_cost_s": 0.2, "quality.relative": True},
    {"token": "secret"},
    {"boxes": [[1.0, 2.0, 3.0, 4.0]]},
)
_SELDOM = (".mjpeg", ".jpg", "/stills", "overlay")
"""What starts a process that decodes: a hundred times as slow."""


class Requests(Target):
    """One request on a connection of its own."""

    name = "http-requests"

    def __init__(self) -> None:
        self._folder = TemporaryDirectory()
        self._loop = asyncio.new_event_loop()
        self._stack = AsyncExitStack()
        self._loop.run_until_complete(self._serve())
        self._fed = 0

    async def _serve(self) -> None:
        config = site(record={"folder": str(Path(self._folder.name) / "kept")})
        service, rng = Fed(config), Random(1)
        service.past.open()
        self._stack.callback(service.close)
        service.pulse0 = 1_700_000_000.0
        for epoch in range(_EPOCHS):
            self._feed_epoch(service, rng, epoch)
        self._app = make_app(service)
        self._paths = self._described()
        self._port = await self._stack.enter_async_context(
            serving(self._app, config.http.model_copy(update={"port": 0}))
        )

    @staticmethod
    def _feed_epoch(service: Fed, rng: Random, epoch: int) -> None:
        for seed, camera in enumerate(CAMERAS):
            for unit in pictures(seed, _EPOCHS * STRIDE)[epoch * STRIDE :][:STRIDE]:
                service.handle(video(camera, unit))
            service.handle(tracks(word(rng, camera, epoch)))
            service.handle(status(camera, epoch))
            service.handle(thumbnail(camera, epoch))
        service.handle(sound(epoch))
        service.pulse = end_of_epoch(epoch, STRIDE)
        service.decide()

    def _described(self) -> list[tuple[str, tuple[str, ...]]]:
        """Give the addresses that the application tells of, each with what can be asked for."""
        found = [("/", ("object",)), ("/operator", ()), ("/api", ()), ("/api/openapi.json", ())]
        for path, item in describe(self._app)["paths"].items():
            for operation in item.values():
                named = tuple(it["name"] for it in operation["parameters"] if it["in"] == "query")
                found.append((path, named))
        return found

    def make(self, rng: Random) -> bytes:
        """Give the bytes of a request."""
        path, queries = rng.choice(self._paths)
        if path.endswith(_SELDOM) and rng.random() < 0.99:
            path, queries = "/api/objects", ()
        for name, values in _NAMES.items():
            while "{" + name + "}" in path:
                value = (
                    rng.choice(values) if rng.random() < 0.8 else quote(str(odd(rng)), errors="replace")[:300]
                )
                path = path.replace("{" + name + "}", value, 1)
        asked = [f"{it}={_value(rng, it)}" for it in queries if rng.random() < 0.5]
        if rng.random() < 0.1:
            name = rng.choice(("overlay", "from", "prefer", "x"))
            asked.append(f"{name}={quote(str(odd(rng)), errors='replace')[:200]}")
        asked = [it for it in asked if it != "overlay=1" or rng.random() < 0.01]
        method = rng.choice(_METHODS)
        body = b""
        if method in {"POST", "PUT", "PATCH"}:
            body = as_json(otherwise(rng, rng.choice(_BODIES)))
            body = damaged(rng, body) if rng.random() < 0.2 else body
        lines = [f"{method} {path}{'?' + '&'.join(asked) if asked else ''} HTTP/1.1", "Host: 127.0.0.1"]
        if rng.random() < 0.1:
            lines.append(rng.choice(_HEADERS))
        if rng.random() < _CHANGES_SHARE:
            lines.append(f"{CHANGES}: 1")  # without it what changes something is refused before it is read
        if body:
            lines += [f"Content-Length: {len(body)}", "Content-Type: application/json"]
        request = "\r\n".join([*lines, "Connection: close", "", ""]).encode("utf-8", "replace") + body
        return damaged(rng, request, WORDS) if rng.random() < 0.3 else request

    def feed(self, data: bytes) -> bool:
        """Ask, and read what is answered at once."""
        return self._loop.run_until_complete(self._ask(data))

    async def _ask(self, data: bytes) -> bool:
        answer = await self._answer(data)
        self._fed += 1
        if self._fed % 100 == 0:
            right = await self._answer(b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
            assert right.startswith(b"HTTP/1.1 200"), right[:200]
        assert b"Traceback" not in answer, answer[:2000].decode("utf-8", "replace")
        code = answer[9:12]
        assert code != b"500", answer[:2000].decode("utf-8", "replace")
        if code.startswith(b"4") and answer.startswith(b"HTTP/1.1"):
            head, _, body = answer.partition(b"\r\n\r\n")
            if b"application/json" in head and not data.startswith(b"HEAD"):
                assert body.startswith(b'{"error":'), body[:300]
        return code.startswith((b"2", b"3"))

    async def _answer(self, data: bytes) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        answer = b""
        try:
            writer.write(data)
            async with asyncio.timeout(_WAIT_S):
                answer = await reader.readuntil(b"\r\n\r\n")
                if not any(
                    it in answer for it in (b"video/", b"event-stream", b"multipart", b"100 Continue")
                ):
                    answer += await reader.read(65_536)
        except (TimeoutError, ConnectionError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass
        finally:
            writer.transport.abort()
            with contextlib.suppress(ConnectionError):
                await writer.wait_closed()
        return answer

    def close(self) -> None:
        """End the server."""
        self._loop.run_until_complete(self._stack.aclose())
        self._loop.close()
        self._folder.cleanup()


_NAMES = {
    "object": ("1", "2", "99", "0", "00001", "-1", "999999999", "1e3", "x", "%31"),
    "camera": ("c0", "c1", "c9", "c%30", "..", "%2e%2e", "c0%00", "*"),
    "segment": ("0", "1", "2", "9999999999", "-1", "x"),
    "part": ("0", "1", "99", "-1", "x"),
    "name": ("x", "..", "run.json"),
}
_HEADERS = (
    "Range: bytes=0-",
    "Accept-Encoding: gzip, \x01",
    "Origin: http://elsewhere",
    "If-None-Match: *",
    "Authorization: Bearer é",
    "Authorization: Basic Zm9v",
    "Cookie: myview=x; a",
    "Expect: 200-ok",
    "Upgrade: websocket",
    "X-Forwarded-Proto: https",
    "Content-Encoding: gzip",
    "Transfer-Encoding: gzip",
)


def _value(rng: Random, name: str) -> str:
    if name in {"from", "to", "at"}:
        return quote(rng.choice(_MOMENTS), safe="+")
    if name in {"camera", "prefer"}:
        return rng.choice(_NAMES["camera"])
    if rng.random() < 0.5:
        return str(rng.choice((0, 1, 2, 5, -1, 10**12)))
    return quote(str(odd(rng)), errors="replace")[:200]


TARGETS = (Requests,)
