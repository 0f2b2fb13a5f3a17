"""Calibration from marked points over HTTP: computed, shown with a plan, and written on request."""

from __future__ import annotations

import base64
import json
from collections.abc import AsyncIterator
from contextlib import aclosing
from pathlib import Path
from typing import Any

import pytest

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.service.fed_site import ServedSite, serve_site
from fakes.setup.room_points import PLACES, error_of, pairs
from server.config.loader import load_config
from server.http.access.csrf import CSRF_HEADER
from server.http.app_keys import SiteControl

PATH = "/api/operator/marked_points"
CHANGES = {CSRF_HEADER: "1"}
TEXT = "# mine\ncameras: [{id: c0, source: 'scene:room'}, {id: c1, source: 'scene:room'}]\n"
POINTS = {"unit": "m", "cameras": {"c0": pairs(0), "c1": pairs(1, *PLACES[:4])}}
NOTHING = {"unit": None, "points": {}, "homographies": {}, "digest": "", "result": None}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture
async def site(path: Path) -> AsyncIterator[ServedSite]:
    async with aclosing(serve_site(control=SiteControl(path))) as sites:
        yield await anext(sites)


async def post(site: ServedSite, body: Any, headers: dict[str, str] = CHANGES) -> tuple[int, Any]:
    async with site.session.post(PATH, json=body, headers=headers) as answer:
        return answer.status, json.loads(await answer.text())


async def test_points_are_calibrated_shown_and_written(site: ServedSite, path: Path) -> None:
    assert await site.get_json(PATH) == NOTHING
    status, answer = await post(site, {"action": "calibrate", "points": POINTS})
    assert (status, {**answer, "result": None}) == (200, NOTHING)
    result = answer["result"]
    assert result["lines"][0].startswith("c0: 6 pairs, off by 0.0")
    assert result["lines"][1] == "c1: 4 pairs always fit exactly; a fifth would show errors"
    assert {camera: len(errors) for camera, errors in result["errors"].items()} == {"c0": 6, "c1": 4}
    assert max(error["image"] for error in result["errors"]["c0"]) < 0.2
    assert base64.b64decode(result["plan"]).startswith(b"\x89PNG")
    assert path.read_text() == TEXT
    status, answer = await post(site, {"action": "apply", "points": POINTS, "digest": answer["digest"]})
    assert (status, answer["unit"], answer["points"]) == (200, "m", POINTS["cameras"])
    assert (path.parent / "site.ground.json").read_text() == result["ground"]
    assert [error_of(camera.ground, at) < 0.1 for at, camera in enumerate(load_config(path).cameras)] == [
        True,
        True,
    ]
    assert await post(site, {"action": "apply", "points": POINTS}) == (
        409,
        {"error": "the calibration in the configuration was changed meanwhile: calibrate again"},
    )


@pytest.mark.parametrize(
    ("body", "status", "error"),
    [
        (
            {"action": "calibrate", "points": {"cameras": {"c0": pairs(0)[:3]}}},
            400,
            "c0: 3 pairs; at least 4",
        ),
        ({"action": "calibrate", "points": {"cameras": {"c7": pairs(0)}}}, 400, "no camera 'c7'"),
        ({"action": "calibrate", "points": {}}, 400, 'has no {"cameras"'),
        ({"action": "calibrate"}, 400, "missing required field `points`"),
        ({"action": "apply", "points": {"cameras": {"c0": pairs(0)[:3]}}}, 409, "c0: 3 pairs; at least 4"),
        ({"action": "fly", "points": {}}, 400, "Invalid enum value"),
        ([], 400, "Expected `object`"),
    ],
)
async def test_invalid_requests_are_one_line_and_change_nothing(
    site: ServedSite, path: Path, body: Any, status: int, error: str
) -> None:
    code, answer = await post(site, body)
    assert code == status
    assert error in answer["error"]
    assert len(answer["error"].splitlines()) == 1
    assert path.read_text() == TEXT


async def test_nothing_is_written_over_a_cameras_own_homography(site: ServedSite, path: Path) -> None:
    own = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    path.write_text(f"cameras: [{{id: c0, source: 'scene:room', ground: {own}}}]\n")
    status, answer = await post(site, {"action": "apply", "points": {"cameras": {"c0": pairs(0)}}})
    assert status == 409
    assert "cameras.c0.ground would take precedence: remove it first" in answer["error"]


async def test_without_a_file_points_can_be_calibrated_but_not_written() -> None:
    async with aclosing(serve_site()) as sites:
        site = await anext(sites)
        assert await site.get_json(PATH) == NOTHING
        status, answer = await post(site, {"action": "calibrate", "points": POINTS})
        assert (status, len(answer["result"]["lines"])) == (200, 2)
        status, answer = await post(site, {"action": "apply", "points": POINTS})
        assert (status, answer["error"]) == (409, "this service has no configuration file")


async def test_an_invalid_file_is_one_line(site: ServedSite, path: Path) -> None:
    path.write_text("cameras: [\n")
    async with site.session.get(PATH) as answer:
        assert answer.status == 409
    status, content = await post(site, {"action": "calibrate", "points": POINTS})
    assert status == 409
    assert "is not valid YAML" in content["error"]


async def test_a_plan_that_cannot_be_drawn_does_not_hide_the_result(
    site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    status, answer = await post(site, {"action": "calibrate", "points": POINTS})
    assert (status, answer["result"]["plan"], len(answer["result"]["lines"])) == (200, "", 2)


async def test_only_operators_calibrate(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "tokens"
    folder.mkdir()
    body = {"action": "apply", "points": POINTS}
    async with serve_with_tokens(folder, control=SiteControl(path)) as site:
        for token in ("desk", "family", "door"):
            assert (await post(site, body, {**CHANGES, **bearer(token)}))[0] == 403
        assert (await post(site, body))[0] == 401
        assert (await post(site, body, bearer("lead")))[0] == 403  # without the header
        assert path.read_text() == TEXT
        assert (await post(site, body, {**CHANGES, **bearer("lead")}))[0] == 200
