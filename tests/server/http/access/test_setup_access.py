"""The set-up page is for the user of this machine alone: a one-time token, a cookie, and no other page."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import aiohttp
import pytest
from aiohttp.test_utils import TestServer

from server.http.access.csrf import CSRF_HEADER
from server.http.setup_app import COOKIE, SetupAccess, make_setup_app
from server.setup.session import SetupSession

SESSION, SETUP = "/api/session", "/api/operator/setup"
CHANGES = {CSRF_HEADER: "1"}


@asynccontextmanager
async def served(path: Path) -> AsyncIterator[tuple[aiohttp.ClientSession, SetupAccess, SetupSession]]:
    access, session = SetupAccess(), SetupSession(path / "site.yaml")
    server = TestServer(make_setup_app(session, access), host="127.0.0.1")
    await server.start_server()
    jar = aiohttp.CookieJar(unsafe=True)
    try:
        async with aiohttp.ClientSession(server.make_url("/"), cookie_jar=jar) as client:
            yield client, access, session
    finally:
        await server.close()


async def sign_in(client: aiohttp.ClientSession, token: str) -> int:
    async with client.post(SESSION, json={"token": token}, headers=CHANGES) as answer:
        return answer.status


async def status_of(client: aiohttp.ClientSession, method: str, path: str, **options: object) -> int:
    async with client.request(method, path, **options) as answer:  # type: ignore[arg-type]
        return answer.status


async def test_the_token_opens_the_page_once(tmp_path: Path) -> None:
    async with served(tmp_path) as (client, access, _):
        assert await status_of(client, "GET", SETUP) == 401
        assert await sign_in(client, "wrong") == 401
        assert await sign_in(client, access.token) == 200
        assert await status_of(client, "GET", SETUP) == 200
        client.cookie_jar.clear()
        assert await status_of(client, "GET", SETUP) == 401
        assert await sign_in(client, access.token) == 401
        assert await status_of(client, "GET", SETUP, cookies={COOKIE: "guessed"}) == 401


@pytest.mark.parametrize(
    "headers",
    [{"X-Forwarded-For": "10.0.0.7"}, {"Host": "cameras.example"}, {"Origin": "https://cameras.example"}],
)
async def test_other_machines_and_other_names_are_refused(tmp_path: Path, headers: dict[str, str]) -> None:
    async with served(tmp_path) as (client, access, _):
        assert await sign_in(client, access.token) == 200
        for path in ("/", "/page/style.css", SETUP):
            assert await status_of(client, "GET", path, headers=headers) == 403


async def test_pages_of_other_sites_can_change_nothing(tmp_path: Path) -> None:
    async with served(tmp_path) as (client, access, session):
        assert await sign_in(client, access.token) == 200
        body = {"name": "x", "fps": 25, "width": 64, "height": 64}
        assert await status_of(client, "POST", f"{SETUP}/site", json=body) == 403
        assert (
            await status_of(
                client,
                "POST",
                f"{SETUP}/site",
                json=body,
                headers={**CHANGES, "Sec-Fetch-Site": "cross-site"},
            )
            == 403
        )
        assert not session.written.is_set()


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/cameras", {"address": "file:///etc/passwd"}),
        ("POST", "/cameras", {"address": "/etc/passwd"}),
        ("POST", "/cameras", {"stream": 3}),
        ("POST", "/cameras", {"address": 7}),
        ("POST", "/cameras", {"address": "x" * 2000}),
        ("POST", "/streams", {"host": "10.0.0.1", "port": 80}),
        ("POST", "/streams", {"host": "10.0.0.1", "port": 0}),
        ("PUT", "/cameras/1", {"name": "x"}),
        ("DELETE", "/cameras/1", None),
        ("GET", "/cameras/1/picture.jpg", None),
        ("POST", "/site", {"name": "x", "fps": 25, "width": 64, "height": 64}),
        ("POST", "/site", {"name": "../x", "fps": 25, "width": 64, "height": 64}),
        ("POST", "/site", [1]),
    ],
)
async def test_invalid_requests_are_one_line(tmp_path: Path, method: str, path: str, body: object) -> None:
    async with served(tmp_path) as (client, access, _):
        assert await sign_in(client, access.token) == 200
        async with client.request(method, f"{SETUP}{path}", json=body, headers=CHANGES) as answer:
            assert answer.status == 400
            error = (await answer.json())["error"]
        assert len(error.splitlines()) == 1
        assert list(tmp_path.iterdir()) == []
