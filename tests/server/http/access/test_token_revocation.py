"""Revoking a token ends its open answers, without a restart."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import threading
from collections.abc import AsyncIterator
from pathlib import Path

import aiohttp
import msgspec
import pytest

from fakes.http.tokens import IN_FUTURE, bearer, serve_with_tokens, token_entry, token_of, write_tokens
from fakes.service.fed_site import A, B, ServedSite
from fakes.service.scripted_cameras import CAMERAS, SMALL
from server.config.tokens_file import secret_digest
from server.http.access.csrf import CSRF_HEADER
from server.http.access.token_store import TokenStore
from server.messaging.camera_identity_snapshot import CameraIdentitySnapshot
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys


@pytest.fixture(autouse=True)
def _check_tokens_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.http.access.authorization._CHECK_EVERY_S", 0.02)


@pytest.fixture
async def site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    async with serve_with_tokens(tmp_path) as served:
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            served.service.feed(epoch, {A: {1: SMALL}, B: {}})
        yield served


async def stream(served: ServedSite, path: str, **heads: str) -> aiohttp.ClientResponse:
    """Open a stream and read its beginning."""
    answer = await served.session.get(path, headers=heads)
    assert answer.status == 200
    assert await answer.content.read(16)
    return answer


async def wait_for_end(answer: aiohttp.ClientResponse) -> None:
    """Read until the server ends the stream."""
    with contextlib.suppress(aiohttp.ClientError):  # aborted, or ended regularly
        while await answer.content.readany():
            pass
    answer.close()


@pytest.mark.parametrize("path", ["/objects/1/best.mp4", "/cameras/c0/live.mp4", "/api/events"])
async def test_revoking_a_token_ends_only_its_streams(site: ServedSite, tmp_path: Path, path: str) -> None:
    by_head = await stream(site, path, **bearer("desk"))
    by_address = await stream(site, f"{path}?token={token_of('desk')}")
    other = await stream(site, path, **bearer("lead"))
    write_tokens(tmp_path / "tokens.yaml", token_entry("lead"))
    await wait_for_end(by_head)
    await wait_for_end(by_address)
    async with site.session.get("/api/objects", headers=bearer("desk")) as answer:
        assert answer.status == 401
    site.service.feed(3, {A: {1: SMALL}, B: {}})
    assert await other.content.readany()
    other.close()


async def test_streams_of_its_sessions_end_too_and_those_of_a_signed_out_session(
    site: ServedSite, tmp_path: Path
) -> None:
    kept = []
    for name in ("desk", "desk", "lead"):
        async with site.session.post(
            "/api/session", headers={CSRF_HEADER: "1"}, json={"token": token_of(name)}
        ) as answer:
            [cookie] = answer.cookies.values()
        site.session.cookie_jar.clear()
        kept.append(f"{cookie.key}={cookie.value}")
    signed_out, revoked, other = [await stream(site, "/api/events", Cookie=cookie) for cookie in kept]
    async with site.session.delete("/api/session", headers={CSRF_HEADER: "1", "Cookie": kept[0]}):
        await wait_for_end(signed_out)
    write_tokens(tmp_path / "tokens.yaml", token_entry("lead"))
    await wait_for_end(revoked)
    assert await other.content.readany()
    other.close()


@pytest.mark.parametrize("path", ["/cameras/c0/live.mp4", "/api/events"])
@pytest.mark.parametrize(
    "less",
    [
        {"camera": "c1"},
        {"object": 9, "made": IN_FUTURE},
        {"blur": "others"},
        {"camera": "c0", "blur": "everybody"},
    ],
)
async def test_streams_outside_a_narrowed_scope_end(
    site: ServedSite, tmp_path: Path, path: str, less: dict[str, object]
) -> None:
    answer = await stream(site, path, **bearer("desk"))
    write_tokens(tmp_path / "tokens.yaml", token_entry("desk", role="watch", **less))
    await wait_for_end(answer)


@pytest.mark.parametrize("path", ["/objects/1/best.mp4", "/cameras/c0/live.mjpeg"])
async def test_a_stream_ends_when_its_token_becomes_blurred(
    site: ServedSite, tmp_path: Path, path: str
) -> None:
    answer = await stream(site, path, **bearer("desk"))
    write_tokens(tmp_path / "tokens.yaml", token_entry("desk", role="watch", blur="others"))
    await wait_for_end(answer)


@pytest.mark.parametrize("path", ["/objects/1/best.mp4", "/objects/1/best.mjpeg"])
async def test_a_persons_stream_ends_when_its_token_becomes_limited_to_that_person(
    site: ServedSite, tmp_path: Path, path: str
) -> None:
    """Otherwise it would show the room after the person has left."""
    answer = await stream(site, path, **bearer("desk"))
    write_tokens(tmp_path / "tokens.yaml", token_entry("desk", role="watch", object=1, made=IN_FUTURE))
    await wait_for_end(answer)


async def test_streams_within_a_changed_scope_continue(site: ServedSite, tmp_path: Path) -> None:
    camera = await stream(site, "/cameras/c0/live.mp4", **bearer("desk"))
    events = await stream(site, "/api/events", **bearer("desk"))
    write_tokens(tmp_path / "tokens.yaml", token_entry("desk", role="watch", camera="c0"))
    await wait_for_end(events)
    site.service.feed(3, {A: {1: SMALL}, B: {}})
    assert await camera.content.readany()
    camera.close()


async def test_a_blocked_disk_does_not_delay_revocation(site: ServedSite, tmp_path: Path) -> None:
    """All threads for recordings wait for it; the file of tokens is on another one."""
    answer = await stream(site, "/api/events", **bearer("desk"))
    hangs = threading.Event()
    waiting = [asyncio.create_task(asyncio.to_thread(hangs.wait, 30.0)) for _ in range(64)]
    await asyncio.sleep(0)
    write_tokens(tmp_path / "tokens.yaml", token_entry("lead"))
    try:
        await asyncio.wait_for(wait_for_end(answer), 10.0)
    finally:
        hangs.set()
        await asyncio.gather(*waiting)


async def test_a_session_expires_in_time_while_the_token_file_is_blocked(
    site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    token_file, hangs = threading.Event(), threading.Event()

    def look(_: TokenStore) -> None:
        token_file.set()
        hangs.wait(30.0)

    sessions = {CSRF_HEADER: "1"}
    async with site.session.post(
        "/api/session", headers=sessions, json={"token": token_of("desk")}
    ) as response:
        [cookie] = response.cookies.values()
    answer = await stream(site, "/api/events", Cookie=f"{cookie.key}={cookie.value}")
    monkeypatch.setattr(TokenStore, "reload_if_changed", look)
    try:
        await asyncio.to_thread(token_file.wait, 10.0)
        monkeypatch.setattr(
            "server.http.access.sessions.Sessions.token_digest_of", lambda *_: None
        )  # 12 hours are over
        await asyncio.wait_for(wait_for_end(answer), 10.0)
    finally:
        hangs.set()


async def test_a_new_token_is_valid_without_a_restart(site: ServedSite, tmp_path: Path) -> None:
    old = await stream(site, "/api/events", **bearer("desk"))
    write_tokens(tmp_path / "tokens.yaml", token_entry("guest", role="watch"))
    await wait_for_end(old)
    async with site.session.get("/api/site", headers=bearer("guest")) as answer:
        assert answer.status == 200


@pytest.mark.parametrize(("remembered", "then"), [(None, 403), (4e9, 403), (1000.0, 404)])
async def test_a_token_for_a_person_is_void_after_numbers_restarted(
    tmp_path: Path, remembered: float | None, then: int
) -> None:
    """Object 1 may be another person; if the cameras have retained the numbers, the token stays valid."""
    async with serve_with_tokens(tmp_path) as served:
        write_tokens(
            tmp_path / "tokens.yaml",
            token_entry("family", role="watch", object=1, made="2026-01-01T00:00:00Z"),
            token_entry("guest", role="watch"),
        )
        served.service.connect_cameras(*CAMERAS)
        if remembered is not None:
            snapshot = CameraIdentitySnapshot(
                pulse=0, boot=1, next_number=9, numbered_since=remembered, people=[]
            )
            key = ZenohKeys("hall").camera("c0", "retained_identities")
            served.service.state_replication.receive_snapshot(
                Message(key, msgspec.msgpack.encode(snapshot), b"")
            )
        while True:  # the file of tokens is looked at now and then
            await asyncio.sleep(0.1)
            async with served.session.get("/api/site", headers=bearer("guest")) as answer:
                if answer.status == 200:
                    break
        async with served.session.get("/objects/1/best.mp4", headers=bearer("family")) as answer:
            assert answer.status == 503, "not known yet"
        served.service.feed(0, {camera: {} for camera in CAMERAS})
        async with served.session.get("/objects/1/best.mp4", headers=bearer("family")) as answer:
            assert answer.status == then
            if then == 403:
                error = (await answer.json())["error"]
                assert error.startswith("person numbers have restarted since the token 'family' was made")


class TokenFileCheck:
    """A token file that is checked by the test."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = TokenStore(write_tokens(path, token_entry("desk")))

    def has(self, name: str) -> bool:
        return self.file.find_in_constant_time(secret_digest(token_of(name))) is not None


@pytest.fixture
def token_file(tmp_path: Path) -> TokenFileCheck:
    return TokenFileCheck(tmp_path / "tokens.yaml")


@pytest.mark.parametrize("text", ["tokens: [", "tokens:\n- {name: desk}\n", "", None])
def test_an_invalid_token_file_keeps_the_old_tokens_and_is_logged_once(
    token_file: TokenFileCheck, text: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    if text is None:
        token_file.path.unlink()
    else:
        token_file.path.write_text(text, encoding="utf-8")
    for _ in range(4):
        token_file.file.reload_if_changed()
        assert token_file.has("desk")
    [line] = caplog.messages
    assert line.endswith("the previous 1 tokens stay in force")
    assert "\n" not in line
    write_tokens(token_file.path, token_entry("lead"))
    for _ in range(2):
        token_file.file.reload_if_changed()
    assert (token_file.has("desk"), token_file.has("lead")) == (False, True)


def test_a_token_file_is_reloaded_only_when_it_stays_unchanged(token_file: TokenFileCheck) -> None:
    token_file.file.reload_if_changed()
    write_tokens(token_file.path)  # half written: an empty list
    token_file.file.reload_if_changed()
    assert token_file.has("desk")
    write_tokens(token_file.path, token_entry("desk"), token_entry("lead"))
    token_file.file.reload_if_changed()
    assert not token_file.has("lead")
    token_file.file.reload_if_changed()
    assert token_file.has("desk")
    assert token_file.has("lead")


def test_a_replaced_file_of_equal_size_and_time_is_reloaded(token_file: TokenFileCheck) -> None:
    other = write_tokens(token_file.path.with_name("new.yaml"), token_entry("lead"))
    before = token_file.path.stat()
    os.utime(other, ns=(before.st_atime_ns, before.st_mtime_ns))
    other.replace(token_file.path)
    for _ in range(2):
        token_file.file.reload_if_changed()
    assert token_file.has("lead")
