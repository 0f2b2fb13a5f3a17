"""Access without tokens, and signing in with one; pages of other sites have no access."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing
from gzip import compress
from json import loads
from pathlib import Path

import pytest
from aiohttp import ClientSession, CookieJar, web
from aiohttp.test_utils import make_mocked_request

from fakes.http.tokens import bearer, serve_with_tokens, token_entry, token_of, write_tokens
from fakes.service.fed_site import ServedSite, serve_site
from server.config.tokens_file import secret_digest
from server.http.access.authentication import COOKIE_PREFIX, Authenticator, Credential
from server.http.access.csrf import CSRF_HEADER
from server.http.access.local_requests import is_local_request
from server.http.access.sessions import Sessions
from server.http.access.wrong_token_rate_limit import WrongTokenRateLimit

SESSION = "/api/session"
CAMERAS = "/api/operator/cameras"
MINE = {CSRF_HEADER: "1"}
HEADS_OF_PROXIES = (
    *("X-Forwarded-Proto", "x-forwarded-proto", "X-Forwarded-Host", "X-Forwarded-Port", "X-Forwarded-Server"),
    *("X-Forwarded-Prefix", "X-Forwarded-Ssl", "X-Forwarded-Scheme", "X-Forwarded", "Forwarded-For"),
    *("X-Original-Forwarded-For", "X-Original-Host", "X-Client-IP", "Client-IP", "True-Client-IP"),
    *(
        "CF-Connecting-IP",
        "CF-Ray",
        "Fastly-Client-IP",
        "X-Cluster-Client-IP",
        "X-Azure-ClientIP",
        "CDN-Loop",
    ),
    *("X-Envoy-External-Address", "Front-End-Https", "X-Amzn-Trace-Id", "X-Scheme", "WL-Proxy-Client-IP"),
)
"""Headers that reveal a proxy; docs/how-to/secure.md requires the first."""


@pytest.fixture
async def site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    """A site with tokens."""
    async with serve_with_tokens(tmp_path) as served:
        yield served


async def request_status(
    served: ServedSite, path: str = SESSION, method: str = "GET", json: object = None, **headers: str
) -> tuple[int, str]:
    """Return the status and the error; headers are named with _ for -."""
    heads = {name.replace("_", "-"): value for name, value in headers.items()}
    async with served.session.request(method, path, headers=heads, json=json) as answer:
        assert "Access-Control-Allow-Origin" not in answer.headers
        return answer.status, (await answer.json()).get("error", "")


async def test_without_tokens_everyone_may_watch_and_only_this_machine_may_operate(
    served: ServedSite,
) -> None:
    session = await served.get_json(SESSION)
    assert session == {"by_token": False, "name": None, "role": "operate", "object": None, "camera": None}
    assert await request_status(served, CAMERAS, Host=f"localhost:{served.port}") == (200, "")
    async with served.session.get(SESSION, headers={"X-Forwarded-For": "10.0.0.7"}) as answer:
        assert (await answer.json())["role"] == "watch"


@pytest.mark.parametrize(
    ("head", "value"),
    [
        ("X-Forwarded-For", "127.0.0.1"),
        ("X-Real-IP", "127.0.0.1"),
        ("Forwarded", "for=127.0.0.1"),
        ("Via", "1.1 proxy"),
        *((head, "https") for head in HEADS_OF_PROXIES),
        ("Host", "cameras.example"),  # a foreign name that resolves to this machine
        ("Origin", "https://cameras.example"),
        ("Referer", "https://cameras.example/operator"),
    ],
)
async def test_without_tokens_other_machines_cannot_operate_and_get_instructions(
    served: ServedSite, head: str, value: str
) -> None:
    status, error = await request_status(served, CAMERAS, **{head.replace("-", "_"): value})
    assert status == 403
    assert "access.tokens" in error
    assert "\n" not in error


def test_usual_headers_of_browsers_and_programs_are_not_proxy_headers() -> None:
    heads = {
        "Host": "localhost",
        "User-Agent": "Mozilla/5.0",
        "Accept": "*/*",
        "Accept-Language": "en",
        "Accept-Encoding": "gzip",
        "Connection": "keep-alive",
        "Cookie": "myview=1",
        "Cache-Control": "no-cache",
        "Sec-Fetch-Site": "same-origin",
        "Sec-CH-UA": '"x"',
        "Priority": "u=1",
        "DNT": "1",
        "Range": "bytes=0-",
        "Upgrade-Insecure-Requests": "1",
        "Origin": "http://localhost",
        "Referer": "http://localhost/",
        "Last-Event-ID": "4",
        "Icy-MetaData": "1",
        "Content-Type": "application/json",
        CSRF_HEADER: "1",
    }
    assert is_local_request(make_mocked_request("GET", CAMERAS, headers=heads).clone(remote="127.0.0.1"))


@pytest.mark.parametrize(
    ("address", "is_local"),
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
def test_loopback_addresses_are_this_machine(address: str, is_local: bool) -> None:
    request = make_mocked_request("GET", CAMERAS, headers={"Host": "localhost"})
    assert is_local_request(request.clone(remote=address)) == is_local


@pytest.mark.parametrize("path", [SESSION, "/api/operator/view_selection"])
@pytest.mark.parametrize("site", ["cross-site", "same-site"])
async def test_pages_of_other_sites_can_neither_read_nor_change_anything(
    served: ServedSite, site: str, path: str
) -> None:
    assert (await request_status(served, path, Sec_Fetch_Site=site))[0] == 403
    assert (await request_status(served, path, method="DELETE", Sec_Fetch_Site=site))[0] == 403
    for method in ("PUT", "POST", "DELETE"):
        status, error = await request_status(served, path, method=method, json={})
        assert status == 403
        assert CSRF_HEADER in error
    preflight = {"Origin": "https://evil.example", "Access_Control_Request_Method": "DELETE"}
    assert (await request_status(served, path, method="OPTIONS", **preflight))[0] == 403


async def test_with_tokens_requests_need_one_and_answers_reveal_none(site: ServedSite) -> None:
    for path in (SESSION, CAMERAS, "/api/objects"):
        async with site.session.get(path) as answer:
            assert answer.status == 401
            assert answer.headers["WWW-Authenticate"] == "Bearer"
    async with site.session.get(CAMERAS, headers={"Authorization": "Bearer wrong"}) as answer:
        assert answer.status == 401
        assert answer.headers["WWW-Authenticate"] == "Bearer"
    assert (await request_status(site, Authorization="Basic d3Jvbmc="))[0] == 401
    for more in ({}, {"X_Forwarded_For": "10.0.0.7"}):
        assert await request_status(site, CAMERAS, **bearer("lead"), **more) == (200, "")
    async with site.session.get("/api/operator/config", headers=bearer("lead")) as answer:
        error = await answer.text()
    assert not any(token_entry(name)["sha256"] in error for name in ("lead", "desk"))


async def test_a_session_describes_the_permissions_of_its_token(site: ServedSite) -> None:
    async with site.session.get(SESSION, headers=bearer("family")) as answer:
        assert await answer.json() == {
            "by_token": True,
            "name": "family",
            "role": "watch",
            "object": 1,
            "camera": None,
        }
    status, error = await request_status(site, CAMERAS, **bearer("desk"))
    assert (status, error) == (403, "the token 'desk' is only for watching")


async def test_players_send_the_token_in_the_query(site: ServedSite) -> None:
    async with site.session.get("/api/objects", params={"token": token_of("desk")}) as answer:
        assert answer.status == 200
    async with site.session.get("/api/objects", params={"token": "wrong"}) as answer:
        assert answer.status == 401


async def sign_in(served: ServedSite, name: str) -> str:
    """Return the cookie, as a browser sends it."""
    async with served.session.post(SESSION, headers=MINE, json={"token": token_of(name)}) as answer:
        assert answer.status == 200
        [cookie] = answer.cookies.values()
    served.session.cookie_jar.clear()
    return f"{cookie.key}={cookie.value}"


async def test_signing_in_sets_an_http_only_cookie_until_signing_out(site: ServedSite) -> None:
    async with site.session.post(SESSION, headers=MINE, json={"token": token_of("lead")}) as answer:
        assert answer.status == 200
        [cookie] = answer.cookies.values()
    assert cookie["httponly"]
    assert cookie["samesite"] == "Strict"
    assert not cookie["secure"]
    assert token_of("lead") not in cookie.value
    kept = f"{cookie.key}={cookie.value}"
    assert await request_status(site, CAMERAS, Cookie=kept) == (200, "")
    async with site.session.delete(SESSION, headers={**MINE, "Cookie": kept}) as answer:
        assert answer.status == 204
    assert (await request_status(site, CAMERAS, Cookie=kept))[0] == 401  # not only forgotten by the browser


async def test_behind_an_https_proxy_the_cookie_is_secure(site: ServedSite) -> None:
    heads = {**MINE, "X-Forwarded-Proto": "https"}
    async with site.session.post(SESSION, headers=heads, json={"token": token_of("desk")}) as answer:
        [cookie] = answer.cookies.values()
    assert cookie["secure"]


async def test_a_token_takes_precedence_over_a_session(site: ServedSite) -> None:
    kept = await sign_in(site, "desk")
    assert (await request_status(site, CAMERAS, Cookie=kept))[0] == 403
    assert (await request_status(site, CAMERAS, Cookie=kept, **bearer("lead")))[0] == 200


async def test_signing_in_to_another_service_of_the_machine_keeps_this_session(
    site: ServedSite, tmp_path: Path
) -> None:
    url = f"http://127.0.0.1:{site.port}{SESSION}"
    tokens = write_tokens(tmp_path / "yard.yaml", token_entry("lead"))
    other = {"site": {"name": "yard"}, "access": {"tokens": str(tokens)}}
    async with (
        aclosing(serve_site(**other)) as sites,
        ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser,
    ):
        for address in (url, f"http://127.0.0.1:{(await anext(sites)).port}{SESSION}", url):
            async with browser.get(address) as answer:
                is_valid = answer.status == 200
            if not is_valid:
                async with browser.post(address, headers=MINE, json={"token": token_of("lead")}) as answer:
                    assert answer.status == 200
    assert is_valid


def test_a_session_expires_and_a_token_has_a_limited_number_of_sessions() -> None:
    now = [0.0]
    sessions = Sessions(lambda: now[0])
    keys = [secret_digest(sessions.open("a")) for _ in range(1024)]
    other = secret_digest(sessions.open("b"))
    assert [sessions.token_digest_of(key) for key in (keys[0], keys[-1], other)] == ["a", "a", "b"]
    now[0] = 1.0
    new = secret_digest(sessions.open("a"))
    assert [sessions.token_digest_of(key) for key in (keys[0], keys[1], new, other)] == [None, "a", "a", "b"]
    now[0] = 12 * 3600.0
    assert [sessions.token_digest_of(key) for key in (keys[1], new)] == [None, "a"]
    assert sessions.token_digest_of("") is None


@pytest.mark.parametrize(
    "head", [b"Authorization: Bearer \xff\xfe", f"Cookie: {COOKIE_PREFIX}_hall_0=".encode() + b"\xff"]
)
async def test_invalid_bytes_are_neither_a_token_nor_a_session(site: ServedSite, head: bytes) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", site.port)
    writer.write(f"GET {SESSION} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n".encode() + head)
    writer.write(b"\r\n\r\n")
    assert (await reader.readline()).split()[1] == b"401"
    writer.close()
    await writer.wait_closed()


async def test_wrong_tokens_are_rate_limited_but_known_valid_ones_are_not(
    site: ServedSite,
) -> None:
    assert (await request_status(site, **bearer("desk")))[0] == 200
    codes = [(await request_status(site, Authorization=f"Bearer {number}"))[0] for number in range(7)]
    assert codes == 5 * [401] + 2 * [429]
    async with site.session.post(SESSION, headers=MINE, json={"token": token_of("lead")}) as answer:
        assert answer.status == 429
        seconds = int(answer.headers["Retry-After"])
        assert 1 <= seconds <= 12
        assert (await answer.json())["error"] == f"too many wrong tokens; try again in {seconds} s"
    assert (await request_status(site, **bearer("desk")))[0] == 200, "others may share the address"
    async with site.session.get("/metrics", headers=bearer("desk")) as answer:
        assert "myview_wrong_tokens_total 5.0" in (await answer.text()).splitlines()


def test_retry_after_is_never_zero(tmp_path: Path) -> None:
    now = [0.0]
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("desk"))
    authenticator = Authenticator(tokens, now=lambda: now[0])
    request = make_mocked_request("GET", "/")
    for _ in range(5):
        authenticator.check_token(request, "wrong")
    now[0] = 12 - 0.1
    answer = authenticator.check_token(request, token_of("desk"))
    assert isinstance(answer, web.Response)
    assert loads(answer.text or "")["error"].endswith("try again in 1 s")
    now[0] = 12.0
    assert authenticator.check_token(request, token_of("desk")) == Credential(secret_digest(token_of("desk")))


async def test_an_expired_cookie_does_not_count_as_a_wrong_token(site: ServedSite) -> None:
    codes = [
        (await request_status(site, Cookie=f"{COOKIE_PREFIX}_hall_0={number}"))[0] for number in range(9)
    ]
    assert codes == 9 * [401]


def test_wrong_tokens_are_forgiven_one_by_one_for_each_address() -> None:
    now = [0.0]
    failures = WrongTokenRateLimit(lambda: now[0])
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
async def test_an_invalid_sign_in_is_refused_with_one_line(site: ServedSite, body: str) -> None:
    async with site.session.post(SESSION, headers=MINE, data=body) as answer:
        assert answer.status == 400
        error = (await answer.json())["error"]
    assert error.startswith("the request's JSON: ")
    assert "\n" not in error


@pytest.mark.parametrize("packing", ["gzip", "deflate"])
async def test_request_bodies_are_not_decompressed(site: ServedSite, packing: str) -> None:
    heads = {**MINE, "Content-Encoding": packing}
    packed = compress(b'{"token": "x"}') if packing == "gzip" else b"nothing packed"
    async with site.session.post(SESSION, headers=heads, data=packed) as answer:
        assert answer.status == 400


async def test_signing_in_without_tokens_is_refused(served: ServedSite) -> None:
    assert (await request_status(served, method="POST", json={"token": "x"}, **{CSRF_HEADER: "1"}))[0] == 400


async def test_the_page_is_public_and_reveals_nothing(site: ServedSite) -> None:
    for path in ("/", "/operator"):
        async with site.session.get(path, headers={"X-Forwarded-For": "10.0.0.7"}) as answer:
            assert answer.status == 200
            assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
            assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
