"""Access rules of all routes: a new route without a rule fails here."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from aiohttp import ClientTimeout, web
from aiohttp.test_utils import TestClient, TestServer

from fakes.http.tokens import TOKEN_ENTRIES, bearer, serve_with_tokens
from fakes.service.fed_site import A, B, ServedSite, show_people
from fakes.service.scripted_cameras import LARGE, SMALL
from server.http.access.authentication import Authenticator
from server.http.access.authorization import ACCESS, AccessControl, authorize
from server.http.access.csrf import CSRF_HEADER
from server.http.app import make_app
from server.service.service import BestViewService

ALL = frozenset(TOKEN_ENTRIES)
NOBODY = "nobody"
ANYBODY = ALL | {NOBODY}
WATCHERS = frozenset({"lead", "desk"})
FAMILY = WATCHERS | {"family"}
"""Of object 1 alone."""
DOOR = WATCHERS | {"door"}
"""Of camera c0 alone."""
BLURRED_PERSON = frozenset({"guest", "carer"})
"""They see other people pixelated, which is possible only in drawn streams; carer: object 1 alone."""
BLURRED_CAMERA = frozenset({"guest", "yard"})
"""Likewise; yard: camera c0 alone."""
SHARP = ALL - BLURRED_PERSON - BLURRED_CAMERA

WHO = {
    "/": ANYBODY,
    "/operator": ANYBODY,
    "/page/{file}": ANYBODY,
    "/api": ANYBODY,
    "/api/openapi.json": ANYBODY,
    "/healthz": ANYBODY,
    "/readyz": ANYBODY,
    "/metrics": WATCHERS,
    "/api/session": ALL,
    "/api/site": ALL,
    "/api/objects": ALL,
    "/api/cameras": ALL,
    "/api/events": ALL,
    "/api/flags": ALL,
    "/api/past": SHARP,
    "/api/past/search": SHARP,
    "/api/delays": ALL,
    "/api/rules": WATCHERS,
    "/api/events/{event}/picture.jpg": WATCHERS,
    "/api/objects/{object}/choice": FAMILY | BLURRED_PERSON,
    "/api/objects/{object}/past": FAMILY,
    "/api/cameras/{camera}/past": DOOR,
    **{
        f"/objects/{{object}}/{path}": FAMILY | BLURRED_PERSON
        for path in ("best.mp4", "best.mjpeg", "best.jpg")
    },
    **{
        f"/objects/{{object}}/{path}": FAMILY
        for path in (
            "best.ts",
            "best.webm",
            "thumb.jpg",
            "whep",
            "whep/{session}",
            "hls/index.m3u8",
            "hls/init.mp4",
            "hls/{segment}.m4s",
            "hls/{segment}.{part}.m4s",
        )
    },
    **{f"/cameras/{{camera}}/{path}": DOOR | BLURRED_CAMERA for path in ("live.mjpeg", "live.jpg")},
    **{
        f"/cameras/{{camera}}/{path}": DOOR
        for path in (
            "live.mp4",
            "live.ts",
            "live.webm",
            "whep",
            "whep/{session}",
            "hls/index.m3u8",
            "hls/init.mp4",
            "hls/{segment}.m4s",
            "hls/{segment}.{part}.m4s",
        )
    },
}
"""The roles that may GET each route; those below /api/operator/ need an operator."""
REFUSED = {401, 403}


def permitted_tokens(method: str, path: str) -> frozenset[str]:
    if path.startswith("/api/operator/"):
        return frozenset({"lead"})
    if path == "/api/session" and method not in {"GET", "HEAD"}:
        return frozenset(ANYBODY)
    return frozenset(WHO[path])


@pytest.fixture
async def site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    async with serve_with_tokens(tmp_path) as served:
        show_people(served)
        yield served


def all_routes(served: ServedSite) -> list[tuple[str, str]]:
    found = {
        (route.method, route.resource.canonical)
        for route in make_app(BestViewService(served.service)).router.routes()
        if route.resource is not None
    }
    return sorted(found)


def fill_path(path: str, number: int = 1, camera: str = A) -> str:
    for name, value in {
        "object": number,
        "camera": camera,
        "event": "1-2-3",
        "key": 1,
        "segment": 0,
        "session": "x" * 22,
        "part": 0,
        "file": "main.js",
    }.items():
        path = path.replace(f"{{{name}}}", str(value))
    return path


async def status(served: ServedSite, method: str, path: str, name: str) -> int:
    """Send a request without waiting for the body, which may be endless."""
    heads = {CSRF_HEADER: "1", **({} if name == NOBODY else bearer(name))}
    async with served.session.request(
        method,
        path,
        headers=heads,
        data=b"" if method in {"POST", "PUT"} else None,
        timeout=ClientTimeout(20),
    ) as answer:
        answer.close()
        return answer.status


async def test_every_route_admits_exactly_the_permitted_tokens(site: ServedSite) -> None:
    routes = all_routes(site)
    assert len(routes) > 60
    wrong = []
    for method, path in routes:
        for name in sorted(ANYBODY):
            if (
                name in permitted_tokens(method, path)
                and method == "GET"
                and (path.endswith((".mjpeg", ".jpg")) or (name not in SHARP and "best.mp4" in path))
            ):
                continue  # HEAD avoids starting a render worker
            code = await status(site, method, fill_path(path), name)
            may = name in permitted_tokens(method, path)
            if (code in REFUSED) == may or (name == NOBODY and not may and code != 401):
                wrong.append(f"{name}: {method} {path}: {code}")
    assert wrong == []


async def test_a_limited_token_sees_only_its_person_or_camera(site: ServedSite) -> None:
    for method, path in all_routes(site):
        if "{object}" in path:
            for name in ("family", "carer"):
                assert await status(site, method, fill_path(path, number=2), name) == 403, path
        if "{camera}" in path:
            for name in ("door", "yard"):
                assert await status(site, method, fill_path(path, camera=B), name) == 403, path


async def test_unknown_and_forbidden_people_get_the_same_answer(site: ServedSite) -> None:
    assert await status(site, "GET", "/objects/99/best.mp4", "family") == 403
    assert await status(site, "GET", "/cameras/none/live.mp4", "door") == 403


async def test_a_token_for_one_person_cannot_fix_the_view_to_a_camera(
    site: ServedSite,
) -> None:
    assert await status(site, "GET", "/objects/1/best.mp4?camera=c0", "family") == 403
    assert await status(site, "GET", "/objects/1/best.mp4?camera=c0", "desk") == 200
    assert await status(site, "GET", "/objects/1/best.mp4?prefer=c0", "family") == 200


async def test_a_token_for_a_person_follows_a_merge_of_their_number(site: ServedSite) -> None:
    assert await status(site, "GET", "/objects/2/best.mp4", "family") == 403
    site.service.decider.people.merge(2, 1)
    site.service.feed(3, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
    assert await status(site, "GET", "/objects/2/best.mp4", "family") == 200
    assert await status(site, "GET", "/objects/1/best.mp4", "family") == 200


async def test_health_checks_need_no_token_and_are_not_rate_limited(site: ServedSite) -> None:
    wrong = {"Authorization": "Bearer unknown-token"}
    for _ in range(100):
        async with site.session.get("/api/site", headers=wrong) as answer:
            if answer.status == 429:  # too many wrong ones
                break
    assert answer.status == 429
    async with site.session.get("/healthz", headers=wrong) as answer:
        assert answer.status == 200


async def test_a_route_without_an_access_rule_is_refused() -> None:
    async def handler(_: web.Request) -> web.Response:
        return web.Response()

    app = web.Application(middlewares=[authorize])
    app[ACCESS] = AccessControl(Authenticator(None), lambda number: number)
    app.router.add_get("/api/new", handler)
    async with TestClient(TestServer(app)) as client, client.get("/api/new") as answer:
        assert answer.status == 403
