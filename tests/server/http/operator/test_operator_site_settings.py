"""Operators change the site's name, rate and size in the configuration; nobody else does."""

from __future__ import annotations

import json
from contextlib import aclosing
from pathlib import Path
from typing import Any

import pytest

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.service.fed_site import ServedSite, serve_site
from server.config.loader import load_config
from server.http.access.csrf import CSRF_HEADER
from server.http.app_keys import SiteControl

PATH = "/api/operator/site_settings"
CHANGES = {CSRF_HEADER: "1"}
TEXT = "site: {name: hall}\ncameras: [{id: c0, source: 'scene:room'}]\n"
WANTED = {"name": "shop", "fps": 12.5, "width": 320, "height": 180}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


async def put(site: ServedSite, body: Any, headers: dict[str, str] = CHANGES) -> tuple[int, Any]:
    async with site.session.put(PATH, json=body, headers=headers) as answer:
        return answer.status, json.loads(await answer.text())


def without_digest(answer: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in answer.items() if key != "digest"}


async def test_the_site_is_changed_in_the_file(path: Path) -> None:
    async with aclosing(serve_site(control=SiteControl(path))) as sites:
        site = await anext(sites)
        before = await site.get_json(PATH)
        digest = before.pop("digest")
        assert before == {"name": "hall", "fps": 25.0, "width": 640, "height": 360}
        status, answer = await put(site, {**WANTED, "digest": digest})
        assert (status, without_digest(answer)) == (200, WANTED)
        assert load_config(path).site.size == (320, 180)
        status, answer = await put(site, {**WANTED, "width": 321})
        assert (status, answer["error"]) == (
            409,
            "site: width: must be even: H.264 stores color at half the size",
        )
        assert (await put(site, {**WANTED, "codec": "x"}))[0] == 400


async def test_a_change_is_refused_if_another_operator_has_made_one_meanwhile(path: Path) -> None:
    async with aclosing(serve_site(control=SiteControl(path))) as sites:
        site = await anext(sites)
        digest = (await site.get_json(PATH))["digest"]
        other = {**WANTED, "width": 640, "height": 480}
        now = (await put(site, {**other, "digest": digest}))[1]
        status, answer = await put(site, {**WANTED, "digest": digest})
        assert status == 409
        assert "changed in the configuration meanwhile" in answer["error"]
        assert load_config(path).site.size == (640, 480)
        assert (await put(site, {**WANTED, "digest": now["digest"]}))[0] == 200
        assert (await put(site, other))[0] == 200  # a script that does not look


async def test_only_operators_see_or_change_it(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "tokens"
    folder.mkdir()
    async with serve_with_tokens(folder, control=SiteControl(path)) as site:
        for token in ("desk", "family", "door"):
            assert (await put(site, WANTED, {**CHANGES, **bearer(token)}))[0] == 403
        assert (await put(site, WANTED, bearer("lead")))[0] == 403  # without the header
        assert (await put(site, WANTED))[0] == 401
        assert path.read_text() == TEXT


async def test_without_a_file_it_cannot_be_changed() -> None:
    async with aclosing(serve_site()) as sites:
        site = await anext(sites)
        assert await put(site, WANTED) == (409, {"error": "this service has no configuration file"})
