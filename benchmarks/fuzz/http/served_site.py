"""A small served site, and the base of its targets."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from asyncio import AbstractEventLoop
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from aiohttp import web

from benchmarks.fuzz.engine.event_loops import TimeSkippingLoop, skip_time_wait
from benchmarks.fuzz.engine.fed_site import FedService, TracksMaker, feed_epoch, make_tracks, site
from benchmarks.fuzz.engine.target import Target
from server.http.api.openapi import describe
from server.http.app import make_app, serving
from server.http.app_keys import SiteControl
from server.service.service import BestViewService

_HEALTH_EVERY = 100
EPOCHS = 6
_WAIT_S = 10.0
"""Seconds to wait for a response, by the time-skipping clock."""
_MAX_BYTES = 65_536
_FILE = "cameras: [{id: c0, source: 'scene:room'}, {id: c1, source: 'scene:room'}]\n"
"""The configuration file that operators' requests change."""
_HEALTH = b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"


class ServedSite:
    """A site that has run for some epochs and is then idle; ``sections`` are added to its configuration.

    ``before`` is called with the application before it is served.
    """

    def __init__(
        self,
        sections: Mapping[str, Any] | None = None,
        make_tracks: TracksMaker = make_tracks,
        loop: AbstractEventLoop | None = None,
        before: Callable[[web.Application], None] = lambda _: None,
    ) -> None:
        self.loop = loop or TimeSkippingLoop()
        self._folder = TemporaryDirectory()
        self._stack = AsyncExitStack()
        self._before = before
        self.loop.run_until_complete(self._serve(dict(sections or {}), make_tracks))

    async def _serve(self, sections: dict[str, Any], make_tracks: TracksMaker) -> None:
        folder = Path(self._folder.name)
        config = site(record={"folder": str(folder / "kept")}, **sections)
        path = folder / "site.yaml"
        path.write_text(_FILE, encoding="utf-8")
        self.service, rng = FedService(config), Random(1)
        self.service.recorder.open()
        self._stack.callback(self.service.close)
        self.service.pulses.pulse0 = 1_700_000_000.0
        for epoch in range(EPOCHS):
            feed_epoch(self.service, rng, epoch, EPOCHS, make_tracks)
        self.app = make_app(BestViewService(self.service), control=SiteControl(path))
        self._before(self.app)
        self.port = await self._stack.enter_async_context(
            serving(self.app, config.http.model_copy(update={"port": 0}))
        )

    @property
    def documented_addresses(self) -> list[tuple[str, tuple[str, ...]]]:
        """Return the addresses in the OpenAPI description, with their query parameters."""
        found = [("/", ("object",)), ("/operator", ()), ("/api", ()), ("/api/openapi.json", ())]
        for path, item in describe(self.app)["paths"].items():
            for operation in item.values():
                named = tuple(
                    parameter["name"] for parameter in operation["parameters"] if parameter["in"] == "query"
                )
                found.append((path, named))
        return found

    def send(self, data: bytes, address: str = "127.0.0.1") -> bytes:
        """Send bytes on a new connection; return the response, or the beginning of a stream."""
        return self.loop.run_until_complete(self._ask(data, address))

    async def _ask(self, data: bytes, address: str) -> bytes:
        answer = b""
        with socket.socket() as client:
            skip_time_wait(client)
            client.bind((address, 0))
            client.connect(("127.0.0.1", self.port))  # the server need not accept it yet
            client.settimeout(0)
            with contextlib.suppress(TimeoutError, ConnectionError):
                async with asyncio.timeout(_WAIT_S):
                    await self.loop.sock_sendall(client, data)
                    while len(answer) < _MAX_BYTES and (
                        more := await self.loop.sock_recv(client, _MAX_BYTES)
                    ):
                        answer += more
        return answer

    def is_healthy(self) -> bool:
        """Return whether the site still answers other clients."""
        return self.send(_HEALTH).startswith(b"HTTP/1.1 200")

    def close(self) -> None:
        """Stop the server."""
        self.loop.run_until_complete(self._stack.aclose())
        self.loop.close()
        self._folder.cleanup()


def check_response(data: bytes, answer: bytes) -> bool:
    """Return whether a request succeeded, after checking that a refusal is one line of JSON."""
    assert b"Traceback" not in answer, answer[:2000].decode("utf-8", "replace")
    code = answer[9:12]
    assert code != b"500", answer[:2000].decode("utf-8", "replace")
    if code.startswith(b"4") and answer.startswith(b"HTTP/1.1"):
        head, _, body = answer.partition(b"\r\n\r\n")
        if b"application/json" in head and not data.startswith(b"HEAD"):
            assert body.startswith(b'{"error":'), body[:300]
    return code.startswith((b"2", b"3"))


class OpenSiteTarget(Target):
    """Requests to a site without access control; the effects of previous ones stay."""

    def __init__(self) -> None:
        self._served = ServedSite()
        self._count = 0

    def feed(self, data: bytes) -> bool:
        """Send the request, and check the response."""
        granted = check_response(data, self._served.send(data))
        self._count += 1
        if self._count % _HEALTH_EVERY == 0:
            assert self._served.is_healthy()
        return granted

    def close(self) -> None:
        """Stop the server."""
        self._served.close()
