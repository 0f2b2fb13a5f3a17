"""Who is at another site, and where requests are led, is told only to viewers whom that site accepts."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fakes.http.tokens import IN_FUTURE, bearer, token_entry, token_of, write_tokens
from fakes.service.linked_sites import LinkedSites, linked_sites
from fakes.service.scripted_cameras import LARGE, SMALL
from server.cli.watch import run_watch
from server.config.sections import HttpSettings
from server.config.tokens_file import secret_digest
from server.http.access.authentication import Credential
from server.http.access.authorization import ACCESS
from server.http.app import make_app, serving
from server.service.service import BestViewService

A, B = 1, 4
OPEN = {"open_to_all": True}
FAMILY = {"role": "watch", "object": 1, "made": IN_FUTURE}


class Served:
    """Two sites, and requests to the hall."""

    def __init__(self, sites: LinkedSites, url: str, session: aiohttp.ClientSession) -> None:
        self.sites, self.url, self._session = sites, url, session

    async def get(self, path: str, name: str | None = None) -> tuple[int, str | None, Any]:
        headers = {} if name is None else bearer(name)
        async with self._session.get(self.url + path, allow_redirects=False, headers=headers) as answer:
            content = await answer.json() if answer.content_type == "application/json" else None
            return answer.status, answer.headers.get("Location"), content

    async def elsewhere(self, name: str | None = None) -> list[dict[str, Any]]:
        _, _, content = await self.get("/api/objects", name)
        return list(content["elsewhere"])


@asynccontextmanager
async def two_sites(hall: dict[str, Any], yard: dict[str, Any], **view: Any) -> AsyncIterator[Served]:
    """Serve two sites; a person walks from the hall into the yard, where somebody else was before."""
    with linked_sites() as sites:
        for name, access in (("hall", hall), ("yard", yard)):
            sites.stop(name)
            sites.start(name, access=access, view=view)
        apps = {name: make_app(BestViewService(service)) for name, service in sites.running.items()}
        async with AsyncExitStack() as stack:
            ports = [
                await stack.enter_async_context(serving(app, HttpSettings(port=0))) for app in apps.values()
            ]
            sites.walk(4, hall={A: SMALL}, yard={B: LARGE})
            sites.walk(2, yard={B: LARGE})
            sites.walk(4, yard={A: SMALL, B: LARGE})
            assert (sites.number("yard", A), sites.number("yard", B)) == (1, 2)
            session = await stack.enter_async_context(aiohttp.ClientSession())
            served = Served(sites, f"http://127.0.0.1:{ports[0]}", session)
            served.yard_access = apps["yard"][ACCESS]  # type: ignore[attr-defined]
            yield served


async def test_viewers_are_led_to_the_site_that_sees_the_person() -> None:
    async with two_sites(OPEN, OPEN) as served:
        there = {"server": "http://yard/", "site": "yard", "visible": True, "token": False}
        assert await served.elsewhere() == [{"object": 1, **there}, {"object": 2, **there}]
        for path in ("objects/1/best.mp4?delay=smooth", "objects/1/hls/index.m3u8", "api/objects/1/choice"):
            assert (await served.get(f"/{path}"))[:2] == (307, f"http://yard/{path}")
        status, location, _ = await served.get("/objects/2/best.ts?token=secret")
        assert (status, location) == (307, "http://yard/objects/2/best.ts"), "a token that is not for it"
        for path in ("/objects/1/best.mp4?from=-5", "/objects/1/thumb.jpg", "/objects/7/best.mp4"):
            assert (await served.get(path))[0] != 307
        merged = served.sites.running["hall"].decision_state.merged
        merged[7] = 1
        path = "/objects/7/best.mp4?delay=smooth"
        assert (await served.get(path))[:2] == (307, "http://yard/objects/1/best.mp4?delay=smooth")
        del merged[7]
        served.sites.walk(3)
        there["visible"] = False
        assert await served.elsewhere() == [{"object": 1, **there}, {"object": 2, **there}]
        served.sites.walk(4, hall={A: SMALL})
        assert await served.elsewhere() == [{"object": 2, **there}]
        assert (await served.get("/objects/1/best.mp4"))[0] != 307


async def test_who_is_still_shown_here_is_not_listed_at_another_site_yet() -> None:
    async with two_sites(OPEN, OPEN, lookahead_s=4.0) as served:
        served.sites.walk(3)
        served.sites.walk(5, hall={A: SMALL})
        served.sites.walk(1.2)
        found = []
        for _ in range(12):
            served.sites.walk(0.4, yard={A: SMALL})
            _, _, objects = await served.get("/api/objects")
            here, there = (
                1 in [person["object"] for person in objects[listed] if person["visible"]]
                for listed in ("objects", "elsewhere")
            )
            is_redirected = (await served.get("/api/objects/1/choice"))[0] == 307
            found.append((here, there, is_redirected))
        assert set(found) == {(True, False, False), (False, True, True)}
        assert found == sorted(found, reverse=True)


async def test_people_at_other_sites_are_listed_in_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    async with two_sites(OPEN, OPEN) as served:
        await run_watch([served.url], None, None, None)
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["1", "yes", "site", "yard"] in rows
    assert ["2", "yes", "site", "yard"] in rows


async def test_a_site_with_tokens_tells_nobody_without_one_who_is_there(tmp_path: Path) -> None:
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("desk"))
    async with two_sites(OPEN, {"tokens": str(tokens)}) as served:
        assert await served.elsewhere() == []
        assert (await served.get("/objects/1/best.mp4"))[0] != 307
        assert (await served.get("/objects/2/best.mp4"))[0] == 404
        assert all(message.viewers is None or not message.viewers.is_open for _, message in told(served))


async def test_a_site_that_is_not_open_to_all_tells_nobody() -> None:
    async with two_sites(OPEN, {}) as served:
        assert await served.elsewhere() == []


async def test_a_token_that_both_sites_accept_shows_who_is_at_the_other(tmp_path: Path) -> None:
    child = {"role": "watch", "object": 2, "made": IN_FUTURE}
    both = [token_entry("desk"), token_entry("family"), token_entry("child", **child)]
    hall = write_tokens(tmp_path / "hall.yaml", *both, token_entry("lead"), token_entry("door"))
    yard = write_tokens(tmp_path / "yard.yaml", *both, token_entry("door"))
    async with two_sites({"tokens": str(hall)}, {"tokens": str(yard)}) as served:
        for name, numbers in (("desk", [1, 2]), ("family", [1]), ("child", [2]), ("lead", []), ("door", [])):
            listed = await served.elsewhere(name)
            assert [person["object"] for person in listed] == numbers, name
            assert all(person["token"] for person in listed)
        path = "objects/1/best.mp4"
        assert (await served.get(f"/{path}", "desk"))[:2] == (307, f"http://yard/{path}")
        query = f"{path}?token={token_of('family')}"
        assert (await served.get(f"/{query}"))[:2] == (307, f"http://yard/{query}")
        assert (await served.get(f"/{path}", "lead"))[0] != 307
        assert (await served.get(f"/{path}", "child"))[0] == 403
        assert (await served.get("/objects/2/best.mp4", "family"))[0] == 403
        sent = [
            digest.digest
            for _, message in told(served)
            if message.viewers
            for digest in message.viewers.tokens
        ]
        assert sent
        hashes = [bytes.fromhex(entry["sha256"]) for entry in both]
        assert not any(digest in whole for digest in sent for whole in hashes)

        write_tokens(yard, token_entry("family"))
        for _ in range(2):  # a changed file is read once it has stayed the same
            served.yard_access.authenticator.file.reload_if_changed()  # type: ignore[attr-defined]
        served.sites.walk(2, yard={A: SMALL, B: LARGE})
        assert await served.elsewhere("desk") == [], "revoked there"
        assert [person["object"] for person in await served.elsewhere("family")] == [1]


async def test_a_token_for_a_person_is_void_once_the_site_of_the_number_begins_anew(
    tmp_path: Path,
) -> None:
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("family", **FAMILY))
    with linked_sites("yard") as sites:
        sites.stop("yard")
        yard = sites.start("yard", access={"tokens": str(tokens)})
        app = make_app(BestViewService(yard))
        authenticator = app[ACCESS].authenticator
        credential = Credential(secret_digest(token_of("family")))

        def refusal() -> str:
            grant = authenticator.grant_of(credential)
            return grant if isinstance(grant, str) else ""

        sites.walk(1, yard={B: LARGE})
        assert "of another site that has not been heard" in refusal()
        sites.start("hall", first=0)
        sites.walk(2, hall={A: SMALL}, yard={B: LARGE})
        write_tokens(tokens, token_entry("family", **FAMILY | {"made": datetime.now(UTC).isoformat()}))
        for _ in range(2):  # a changed file is read once it has stayed the same
            authenticator.file.reload_if_changed()  # type: ignore[union-attr]
        assert sites.elsewhere("yard") == {1: "hall"}
        assert refusal() == ""
        assert authenticator.tokens_of_viewers()
        sites.stop("hall")
        sites.walk(1, yard={B: LARGE})
        assert refusal() == ""
        sites.start("hall")
        sites.walk(3, hall={A + 8: SMALL}, yard={B: LARGE})
        assert refusal().startswith("person numbers have restarted since the token 'family' was made")
        assert not authenticator.tokens_of_viewers()


def told(served: Served) -> list[tuple[str, Any]]:
    return [message for message in served.sites.told if message[0] == "yard"]
