"""Identity overrides by the operator, as the API and viewers show them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any

import pytest

from bestview import IdentityRegistry
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL
from server.cli.watch import run_watch
from server.http.access.csrf import CSRF_HEADER
from server.service.view_selection.decider import camera_homographies

PEOPLE = "/api/operator/people"


@pytest.fixture
async def identifying_site() -> AsyncIterator[ServedSite]:
    """Serve a site with two people: one in both cameras, the other only in c0."""
    async with aclosing(serve_site()) as sites:
        served = await anext(sites)
        config = served.service.config
        served.service.decider.people._registry = IdentityRegistry(
            config.view.identity, camera_homographies(config)
        )
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            feed(served, epoch)
        yield served


def feed(served: ServedSite, epoch: int) -> None:
    served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})


async def post_edit(served: ServedSite, **edit: Any) -> tuple[int, Any]:
    async with served.session.post(PEOPLE, headers={CSRF_HEADER: "1"}, json=edit) as answer:
        return answer.status, await answer.json()


async def objects(served: ServedSite) -> dict[int, Any]:
    return {person["object"]: person for person in (await served.get_json("/api/objects"))["objects"]}


async def test_a_persons_name_appears_in_every_list(site_with_people: ServedSite) -> None:
    assert (await post_edit(site_with_people, object=1, name=" Ann  Lee "))[0] == 200
    assert (await objects(site_with_people))[1]["name"] == "Ann Lee"
    assert (await objects(site_with_people))[2]["name"] is None
    assert (await site_with_people.get_json(PEOPLE))["names"] == {"1": "Ann Lee"}
    await post_edit(site_with_people, object=1, name="")
    assert (await objects(site_with_people))[1]["name"] is None


async def test_a_name_is_listed_unchanged(
    site_with_people: ServedSite, capsys: pytest.CaptureFixture[str]
) -> None:
    await post_edit(site_with_people, object=1, name="Ann [bold]")
    await run_watch([f"http://127.0.0.1:{site_with_people.port}"], None, None, None, None, None)
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[:3] == ["1", "Ann", "[bold]"] for line in lines)
    assert any(line.split()[:2] == ["2", "yes"] for line in lines)


async def test_merged_people_have_one_number_from_the_next_gop_on(identifying_site: ServedSite) -> None:
    people = await objects(identifying_site)
    kept, lost = sorted(people)[:2]
    decisions: list[Any] = []
    identifying_site.service.on_decision.append(decisions.append)
    status, answer = await post_edit(identifying_site, object=kept, merge=lost)
    assert (await post_edit(identifying_site, object=lost, name="Bob"))[0] == 200, (
        "the merged number is valid at once"
    )
    assert (status, answer["merged"]) == (200, {str(lost): kept})
    for epoch in range(3, 8):
        feed(identifying_site, epoch)
    assert [(merge.kept, merge.lost) for gop in decisions for merge in gop.merged] == [(kept, lost)]
    people = await objects(identifying_site)
    assert lost not in people
    assert people[kept]["aliases"] == [lost]
    assert people[kept]["name"] == "Bob"
    assert (await identifying_site.get_json(f"/api/objects/{lost}/choice"))["object"] == kept
    assert (await post_edit(identifying_site, object=kept, merge=lost))[0] == 400


async def test_a_person_split_off_has_a_new_number_for_all_viewers(identifying_site: ServedSite) -> None:
    number = identifying_site.service.decider.people.number(A, 1, 10)
    assert number is not None
    decisions: list[Any] = []
    identifying_site.service.on_decision.append(decisions.append)
    status, answer = await post_edit(identifying_site, object=number, split=[A])
    assert status == 200
    new = answer["new_object"]
    for epoch in range(3, 8):
        feed(identifying_site, epoch)
    splits = [(split.kept, split.new_object, split.camera) for gop in decisions for split in gop.split]
    assert splits == [(number, new, A)]
    assert A in (await objects(identifying_site))[new]["cameras"]
    assert (await identifying_site.get_json(f"/api/objects/{new}/choice"))["camera"] is not None


@pytest.mark.parametrize(
    ("edit", "status", "error"),
    [
        ({"object": 9, "name": "Ann"}, 404, "there is no object 9"),
        ({"object": 1, "merge": 9}, 404, "there is no object 9"),
        ({"object": 1, "merge": 1}, 400, "object 1 is object 1 already"),
        ({"object": 1, "split": ["c9"]}, 404, "there is no camera 'c9'; there are c0, c1"),
        ({"object": 1}, 400, "set exactly one of name, merge and split"),
        ({"object": 1, "name": "Ann", "merge": 2}, 400, "set exactly one of name, merge and split"),
        ({"object": 1, "name": 41 * "x"}, 400, "name: at most 40 printable characters"),
        ({"object": 1, "name": "a\u202eb"}, 400, "name: at most 40 printable characters"),
        ({"object": "1"}, 400, "the request's JSON: "),
    ],
)
async def test_an_invalid_edit_is_refused_with_one_line(
    site_with_people: ServedSite, edit: dict[str, Any], status: int, error: str
) -> None:
    response = await post_edit(site_with_people, **edit)
    assert response[0] == status
    assert response[1]["error"].startswith(error)


async def test_people_cannot_be_edited_on_a_sharded_site() -> None:
    async with aclosing(serve_site(view={"sharding": {"of": 2}})) as sites:
        served = await anext(sites)
        status, response = await post_edit(served, object=1, name="Ann")
        assert status == 409
        assert (await served.get_json(PEOPLE))["unavailable"] == response["error"]
