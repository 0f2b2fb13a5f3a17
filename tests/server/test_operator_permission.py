"""Who may operate a site, and what a page of another site can make a browser do: nothing."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing
from json import loads

import pytest
from aiohttp import ClientSession, CookieJar
from aiohttp.test_utils import make_mocked_request
from command_line import Run
from halls import Hall, opened

from server.web.operator_permission import CHANGES, COOKIE, Failures, Permission, digest_of

SESSION = "/api/operator/session"
TOKEN = "a token of theirs"  # noqa: S105 — of a test
MINE = {CHANGES: "1"}


@pytest.fixture
async def locked() -> AsyncIterator[Hall]:
    """Serve a site whose configuration has a token."""
    async for it in opened(http={"operator_token": digest_of(TOKEN)}):
        yield it


async def asked(
    hall: Hall, path: str = SESSION, method: str = "GET", json: object = None, **headers: str
) -> tuple[int, str]:
    """Give the status and the error; heads are given with _ for -."""
    heads = {name.replace("_", "-"): value for name, value in headers.items()}
    async with hall.session.request(method, path, headers=heads, json=json) as answer:
        assert "Access-Control-Allow-Origin" not in answer.headers
        return answer.status, (await answer.json()).get("error", "")


async def test_without_a_token_this_machine_may(hall: Hall) -> None:
    assert await hall.get_json(SESSION) == {"by_token": False}
    assert await asked(hall, Host=f"localhost:{hall.port}") == (200, "")


@pytest.mark.parametrize(
    ("head", "value"),
    [
        ("X-Forwarded-For", "127.0.0.1"),
        ("X-Real-IP", "127.0.0.1"),
        ("Forwarded", "for=127.0.0.1"),
        ("Via", "1.1 proxy"),
        ("Host", "cameras.example"),  # a name that somebody made lead to this machine
        ("Origin", "https://cameras.example"),
        ("Referer", "https://cameras.example/operator"),
    ],
)
async def test_without_a_token_nobody_else_may_and_one_line_says_what_to_set(
    hall: Hall, head: str, value: str
) -> None:
    status, error = await asked(hall, **{head.replace("-", "_"): value})
    assert status == 403
    assert "http.operator_token" in error
    assert "\n" not in error


@pytest.mark.parametrize(
    ("address", "here"),
    [
        ("127.0.0.1", True),
        ("127.8.0.1", True),
        ("::1", True),
        ("::ffff:127.0.0.1", True),
        ("192.168.1.4", False),
        ("::ffff:192.168.1.4", False),
        ("fe80::1%eth0", False),
        ("", False),
        ("localhost", False),
    ],
)
def test_which_addresses_are_this_machine(address: str, here: bool) -> None:
    request = make_mocked_request("GET", SESSION, headers={"Host": "localhost"})
    refused = Permission(None).refusal(request.clone(remote=address))
    assert (refused is None) == here


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
async def test_no_page_of_another_site_learns_or_changes_anything(hall: Hall, site: str) -> None:
    assert (await asked(hall, Sec_Fetch_Site=site))[0] == 403
    assert (await asked(hall, method="DELETE", Sec_Fetch_Site=site))[0] == 403
    for method in ("POST", "DELETE"):
        status, error = await asked(hall, method=method, json={})
        assert status == 403
        assert CHANGES in error
    asks = {"Origin": "https://evil.example", "Access_Control_Request_Method": "DELETE"}
    assert (await asked(hall, method="OPTIONS", **asks))[0] == 403


async def test_a_token_is_needed_where_there_is_one_and_nobody_is_told_of_it(locked: Hall) -> None:
    async with locked.session.get(SESSION) as answer:
        assert answer.status == 401
        assert answer.headers["WWW-Authenticate"] == "Bearer"
    assert (await asked(locked, Authorization="Bearer wrong"))[0] == 401
    assert await asked(locked, Authorization=f"Bearer {TOKEN}") == (200, "")
    assert await asked(locked, Authorization=f"Bearer {TOKEN}", X_Forwarded_For="10.0.0.7") == (200, "")
    assert digest_of(TOKEN) not in repr(await locked.get("/api/openapi.json"))


async def test_who_signs_in_has_a_cookie_that_no_script_reads_and_signs_out(locked: Hall) -> None:
    async with locked.session.post(SESSION, headers=MINE, json={"token": TOKEN}) as answer:
        assert answer.status == 200
        [cookie] = answer.cookies.values()
    assert cookie["httponly"]
    assert cookie["samesite"] == "Strict"
    assert TOKEN not in cookie.value
    kept = f"{cookie.key}={cookie.value}"
    assert await asked(locked, Cookie=kept) == (200, "")
    async with locked.session.delete(SESSION, headers={**MINE, "Cookie": kept}) as answer:
        assert answer.status == 200
    assert (await asked(locked, Cookie=kept))[0] == 401  # not only forgotten by the browser


async def test_who_signs_in_to_another_service_of_the_machine_stays_signed_in_here(locked: Hall) -> None:
    url = f"http://127.0.0.1:{locked.port}{SESSION}"
    other = {"site": {"name": "yard"}, "http": {"operator_token": digest_of(TOKEN)}}
    async with (
        aclosing(opened(**other)) as halls,
        ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser,
    ):
        for site in (url, f"http://127.0.0.1:{(await anext(halls)).port}{SESSION}", url):
            async with browser.get(site) as answer:
                known = answer.status == 200
            if not known:
                async with browser.post(site, headers=MINE, json={"token": TOKEN}) as answer:
                    assert answer.status == 200
    assert known


async def test_a_session_ends_and_so_do_the_oldest_of_very_many() -> None:
    now = [0.0]
    permission = Permission(digest_of(TOKEN), lambda: now[0])

    def may(session: str) -> bool:
        request = make_mocked_request("GET", SESSION, headers={"Cookie": f"{permission.cookie}={session}"})
        return permission.refusal(request) is None

    first = permission.open_session()
    assert may(first)
    assert not may(first + "x")
    now[0] = 1.0
    later = [permission.open_session() for _ in range(64)]
    assert not may(first)
    assert all(may(it) for it in later)
    now[0] = 13 * 3600.0
    assert not may(later[-1])


@pytest.mark.parametrize(
    "head", [b"Authorization: Bearer \xff\xfe", f"Cookie: {COOKIE}_hall_0=".encode() + b"\xff"]
)
async def test_bytes_that_are_no_text_are_no_token_and_no_sign_in(locked: Hall, head: bytes) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", locked.port)
    writer.write(f"GET {SESSION} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n".encode() + head)
    writer.write(b"\r\n\r\n")
    assert (await reader.readline()).split()[1] == b"401"
    writer.close()
    await writer.wait_closed()


async def test_wrong_tokens_are_limited_in_rate_and_the_right_one_waits_too(locked: Hall) -> None:
    codes = [(await asked(locked, Authorization=f"Bearer {it}"))[0] for it in range(7)]
    assert codes == 5 * [401] + 2 * [429]
    async with locked.session.post(SESSION, headers=MINE, json={"token": TOKEN}) as answer:
        assert answer.status == 429
        seconds = int(answer.headers["Retry-After"])
        assert 1 <= seconds <= 12
        assert (await answer.json())["error"] == f"too many wrong tokens; try again in {seconds} s"


def test_nobody_is_told_to_wait_for_no_time() -> None:
    now = [0.0]
    permission = Permission(digest_of(TOKEN), lambda: now[0])
    request = make_mocked_request("GET", "/")
    for _ in range(5):
        permission.token_refusal(request, "wrong")
    now[0] = 12 - 0.1
    answer = permission.token_refusal(request, TOKEN)
    assert answer is not None
    assert loads(answer.text or "")["error"].endswith("try again in 1 s")
    now[0] = 12.0
    assert permission.token_refusal(request, TOKEN) is None


def test_failures_are_forgotten_one_by_one_and_each_address_has_its_own() -> None:
    now = [0.0]
    failures = Failures(lambda: now[0])
    for _ in range(6):
        failures.add("10.0.0.7")
    assert failures.wait("10.0.0.7") == pytest.approx(24.0)
    assert failures.wait("10.0.0.8") == 0
    now[0] = 24.0
    assert failures.wait("10.0.0.7") == 0
    failures.add("10.0.0.7")
    assert failures.wait("10.0.0.7") == pytest.approx(12.0)
    for other in range(3000):
        failures.add(str(other))
    assert len(failures._until) <= 1024


@pytest.mark.parametrize("body", ["", "no JSON", "[]", '{"token": 7}', '{"token": "x", "more": 1}'])
async def test_what_is_no_sign_in_is_said_in_one_line(locked: Hall, body: str) -> None:
    async with locked.session.post(SESSION, headers=MINE, data=body) as answer:
        assert answer.status == 400
        error = (await answer.json())["error"]
    assert error.startswith("the request's JSON: ")
    assert "\n" not in error


async def test_there_is_nothing_to_sign_in_to_without_a_token(hall: Hall) -> None:
    assert (await asked(hall, method="POST", json={"token": "x"}, **{CHANGES: "1"}))[0] == 400


async def test_the_page_itself_is_for_everybody_and_tells_nothing(locked: Hall) -> None:
    async with locked.session.get("/operator", headers={"X-Forwarded-For": "10.0.0.7"}) as answer:
        assert answer.status == 200
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
        assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]


def test_a_new_token_fits_the_line_that_comes_with_it(myview: Run) -> None:
    done = myview("operator-token")
    lines = [it.strip() for it in done.out.splitlines()]
    token = lines[1]
    assert f'operator_token: "{digest_of(token)}"' in lines
    assert myview("operator-token").out.splitlines()[1].strip() != token
