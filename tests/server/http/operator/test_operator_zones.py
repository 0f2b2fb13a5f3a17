"""Operators save and remove zones with their rules; nobody else does; they apply while the service runs."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import aclosing
from pathlib import Path
from typing import Any

import pytest

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.service.fed_site import ServedSite, apply_saved_zones, serve_site
from server.config.loader import load_config
from server.http.access.csrf import CSRF_HEADER
from server.http.app_keys import SiteControl

PATH = "/api/operator/zones"
CHANGES = {CSRF_HEADER: "1"}
TEXT = "# mine\ncameras: [{id: c0, source: 'scene:room'}, {id: c1, source: 'scene:room'}]\n"
RULE = {"rule": "in", "kind": "entered"}
ALWAYS: dict[str, Any] = {
    **dict.fromkeys(("direction", "longer_than_s", "more_than", "closer_than_m", "hold_s", "days", "hours")),
    "people": [],
    "cameras": [],
}
ZONE: dict[str, Any] = {"zone": "till", "camera": "c0", "area": [[0, 0], [32, 0], [32, 48]], "rules": [RULE]}
LISTED: dict[str, Any] = {
    **ZONE,
    "line": None,
    "inner": None,
    "rules": [{**ALWAYS, **RULE}],
}
NO_FILE = "this service has no configuration file"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture
async def site(path: Path) -> AsyncIterator[ServedSite]:
    served: list[ServedSite] = []
    control = SiteControl(path, reload=lambda: apply_saved_zones(path, served[0]))
    async with aclosing(serve_site(control=control)) as sites:
        served.append(await anext(sites))
        yield served[0]


async def send(
    site: ServedSite, method: str, body: Any, headers: dict[str, str] = CHANGES
) -> tuple[int, dict[str, Any]]:
    async with site.session.request(method, PATH, json=body, headers=headers) as answer:
        return answer.status, without_digest(json.loads(await answer.text()))


def without_digest(answer: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in answer.items() if key != "digest"}


async def test_a_zone_is_saved_changed_and_removed_and_applies(site: ServedSite, path: Path) -> None:
    nothing = {"unavailable": "", "in_force": True, "unit": "", "zones": [], "rules": []}
    assert without_digest(await site.get_json(PATH)) == nothing
    assert await send(site, "PUT", ZONE) == (200, {**nothing, "zones": [LISTED]})
    assert [zone["zone"] for zone in (await site.get_json("/api/rules"))["zones"]] == ["till"]
    line = {"zone": "door", "line": [[0, 0], [4, 0]], "inner": [2, 2], "rules": [], "replaces": "till"}
    listed = {"zone": "door", "camera": None, "area": None, **line}
    del listed["replaces"]
    assert await send(site, "PUT", line) == (200, {**nothing, "zones": [listed]})
    assert path.read_text().startswith("# mine\n")
    assert await send(site, "DELETE", {"zone": "door"}) == (200, nothing)
    assert (await site.get_json("/api/rules"))["zones"] == []
    assert len(list(path.parent.glob("site.2*.yaml"))) == 3


async def test_rules_with_schedules_are_saved_on_a_zone_and_on_none(site: ServedSite, path: Path) -> None:
    night = {"rule": "night", "kind": "crowded", "more_than": 0, "hold_s": 5.0, "days": ["fri", "sat"]}
    night |= {"hours": ["22:00", "06:00"], "people": [3, "Ann"], "cameras": ["c0"]}
    status, answer = await send(site, "PUT", {**ZONE, "rules": [night]})
    assert (status, answer["in_force"], answer["zones"][0]["rules"]) == (200, True, [{**ALWAYS, **night}])
    status, answer = await send(site, "PUT", {"zone": None, "rules": [{**night, "rule": "anywhere"}, RULE]})
    assert (status, answer["in_force"]) == (200, True)
    assert answer["rules"] == [{**ALWAYS, **night, "rule": "anywhere"}, {**ALWAYS, **RULE}]
    assert answer["zones"][0]["rules"] == [{**ALWAYS, **night}]
    assert [rule.id for rule in site.service.config.rules] == ["night", "anywhere", "in"]
    assert (await send(site, "PUT", {"zone": None}))[1]["rules"] == []
    assert [rule.id for rule in load_config(path).rules] == ["night"]


async def test_a_change_of_what_others_changed_meanwhile_is_refused(site: ServedSite, path: Path) -> None:
    before = (await site.get_json(PATH))["digest"]
    assert (await send(site, "PUT", {**ZONE, "digest": before}))[0] == 200
    text = path.read_text()
    for method, body in (
        ("PUT", {**ZONE, "replaces": "till", "digest": before}),
        ("PUT", {"zone": None, "rules": [], "digest": before}),
        ("DELETE", {"zone": "till", "digest": before}),
    ):
        status, answer = await send(site, method, body)
        assert status == 409
        assert "were changed in the configuration meanwhile" in answer["error"]
    assert path.read_text() == text
    now = (await site.get_json(PATH))["digest"]
    assert (await send(site, "DELETE", {"zone": "till", "digest": now}))[0] == 200


async def test_a_change_that_waits_for_a_restart_says_so(site: ServedSite, path: Path) -> None:
    other = load_config(path).model_copy(update={"zones": []})
    path.write_text(path.read_text() + "zones: [{id: hall, area: [[0, 0], [9, 0], [9, 9]]}]\n")
    answer = await site.get_json(PATH)
    assert (answer["in_force"], [zone["zone"] for zone in answer["zones"]]) == (False, ["hall"])
    assert site.service.config.zones == other.zones


@pytest.mark.parametrize(
    ("method", "body", "status", "error"),
    [
        ("PUT", {**ZONE, "area": ZONE["area"][:2]}, 409, "the zone: area: List should have at least 3 items"),
        ("PUT", {**ZONE, "area": None}, 409, "needs either area, its corners, or line"),
        ("PUT", {**ZONE, "zone": "../x"}, 409, "the zone: id: "),
        ("PUT", {**ZONE, "camera": "c7"}, 409, "there is no camera 'c7'"),
        ("PUT", {**ZONE, "rules": [{"rule": "a", "kind": "wave"}]}, 409, "rule 1: kind: Input should be"),
        ("PUT", {**ZONE, "replaces": "hall"}, 409, "there is no zone 'hall'"),
        ("PUT", {**ZONE, "hold_s": 3}, 400, "unknown field `hold_s`"),
        ("PUT", {**ZONE, "area": [[0, 0, 0]]}, 400, "length 2"),
        ("PUT", {**ZONE, "area": "all"}, 400, "Expected `array | null`"),
        ("PUT", {}, 400, "missing required field `zone`"),
        ("DELETE", {"zone": "till"}, 409, "there is no zone 'till'"),
        ("DELETE", {"zone": 1}, 400, "Expected `str`"),
        ("DELETE", [], 400, "Expected `object`"),
    ],
)
async def test_an_invalid_request_is_one_line_and_changes_nothing(
    site: ServedSite, path: Path, method: str, body: Any, status: int, error: str
) -> None:
    code, answer = await send(site, method, body)
    assert code == status
    assert error in answer["error"]
    assert len(answer["error"].splitlines()) == 1
    assert path.read_text() == TEXT


async def test_a_change_needs_the_header_that_no_other_site_can_send(site: ServedSite, path: Path) -> None:
    assert (await send(site, "PUT", ZONE, {}))[0] == 403
    assert (await send(site, "DELETE", {"zone": "till"}, {}))[0] == 403
    assert path.read_text() == TEXT


async def test_only_operators_see_or_change_zones(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "tokens"
    folder.mkdir()
    async with serve_with_tokens(folder, control=SiteControl(path)) as site:
        for token in ("desk", "family", "door"):
            for method in ("GET", "PUT", "DELETE"):
                assert (await send(site, method, ZONE, {**CHANGES, **bearer(token)}))[0] == 403
        assert (await send(site, "PUT", ZONE))[0] == 401
        assert path.read_text() == TEXT
        status, answer = await send(site, "PUT", ZONE, {**CHANGES, **bearer("lead")})
        assert (status, answer["in_force"]) == (200, False)


@pytest.mark.parametrize(
    ("control", "text", "settings", "error"),
    [
        (False, TEXT, {}, NO_FILE),
        (True, "cameras: [\n", {}, "is not valid YAML"),
        (True, TEXT, {"view": {"sharding": {"of": 2}}}, "several services (view.sharding)"),
    ],
)
async def test_where_zones_cannot_be_changed_those_in_force_are_shown_with_the_reason(
    path: Path, control: bool, text: str, settings: dict[str, Any], error: str
) -> None:
    path.write_text(text)
    zone = {"id": "till", "camera": "c0", "area": ZONE["area"]}
    controls = SiteControl(path if control else None)
    async with aclosing(serve_site(control=controls, zones=[zone], **settings)) as sites:
        site = await anext(sites)
        answer = await site.get_json(PATH)
        assert error in answer["unavailable"]
        assert [zone["zone"] for zone in answer["zones"]] == ["till"]
        for method, body in (("PUT", ZONE), ("DELETE", {"zone": "till"})):
            status, answer = await send(site, method, body)
            assert status == 409
            assert error in answer["error"]
    assert path.read_text() == text
