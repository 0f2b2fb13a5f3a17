"""`myview delete-person` prints what would be deleted of a person, and deletes it when told so."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from aiohttp import web
from aiohttp.test_utils import TestServer

import client
from client import deletion as client_deletion
from fakes.cli.command_line import RunCommand, input_error
from fakes.http.tokens import bearer, token_of
from fakes.service.fed_site import ServedSite
from fakes.service.recorded_people import EPOCHS, FEET, serve_recorded_people, show
from fakes.system.ports import free_port
from server.cli.person_deletion import run_delete_person
from server.service.facade import deletion_plan
from server.system.errors import UnavailableError, UserError


@pytest.fixture
async def site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    async with serve_recorded_people(tmp_path) as served:
        yield served


async def run(site: ServedSite, number: int = 1, token: str = "lead", **options: Any) -> None:  # noqa: S107
    chosen = {"recordings": None, "run": None, "for_good": False, "as_json": False} | options
    await run_delete_person(f"http://127.0.0.1:{site.port}", number, token=token_of(token), **chosen)


async def numbers(site: ServedSite) -> set[int]:
    async with site.session.get("/api/objects", headers=bearer("lead")) as answer:
        return {each["object"] for each in (await answer.json())["objects"]}


def files(folder: Path) -> set[Path]:
    return set((folder / "kept").rglob("cameras/*/*.mp4"))


async def test_without_for_good_it_prints_what_goes_and_what_others_lose(
    site: ServedSite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files(tmp_path)
    await run(site)
    whose, always, media, others, *mentions, nothing = capsys.readouterr().out.splitlines()
    assert whose == "object 1 'Ann', with all numbers: 1"
    assert always == "  name, looks and tracks; recorded decisions: 15 (seen for 2.6 s); events: 1"
    assert media.startswith("  video and sound, with --recordings delete: c0 ")
    assert others.startswith("  of it in best views of others: object 2 ")
    assert "  for you to change: rules: ann names them" in mentions
    assert nothing.startswith("nothing is deleted: --for-good")
    assert 1 in await numbers(site)
    assert files(tmp_path) == before


async def test_for_good_deletes_the_person_and_keeps_the_recordings(
    site: ServedSite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files(tmp_path)
    await run(site, recordings="keep", for_good=True)
    output = capsys.readouterr().out
    assert output.splitlines()[-1] == "deleted"
    assert "video" not in output, "which stays"
    assert await numbers(site) == {2}
    assert files(tmp_path) == before
    with pytest.raises(UserError, match=r"^delete-person: .*1"):
        await run(site)


async def test_for_good_deletes_the_recordings_too(
    site: ServedSite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files(tmp_path)
    await run(site, recordings="delete", for_good=True, as_json=True)
    printed = json.loads(capsys.readouterr().out)
    assert (printed["state"], printed["recordings"], printed["objects"]) == ("done", "delete", [1])
    assert files(tmp_path) < before


async def test_whoever_is_visible_goes_on_as_a_new_person(
    site: ServedSite, capsys: pytest.CaptureFixture[str]
) -> None:
    for epoch in range(EPOCHS, EPOCHS + 3):
        show(site, epoch, ann=FEET)
    await run(site)
    assert "; visible now, and goes on as a new person" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("token", "options", "error"),
    [
        ("lead", {"number": 77}, "delete-person: .*77"),
        ("lead", {"run": "20200101T000000Z"}, "delete-person: run: there is no recorded session '20200101"),
        ("lead", {"for_good": True}, "delete-person: --for-good needs --recordings keep or"),
        ("desk", {}, "delete-person: the token 'desk' is only for watching"),
        ("nobody", {}, "delete-person: "),
    ],
)
async def test_what_is_refused_is_one_line_and_deletes_nothing(
    site: ServedSite, tmp_path: Path, token: str, options: dict[str, Any], error: str
) -> None:
    before = files(tmp_path)
    with pytest.raises(UserError, match=f"^{error}") as caught:
        await run(site, token=token, **{"recordings": None, **options})
    assert "\n" not in str(caught.value)
    assert await numbers(site) == {1, 2}
    assert files(tmp_path) == before


async def test_a_disk_that_is_gone_is_one_line_and_deletes_nothing(site: ServedSite, tmp_path: Path) -> None:
    (session,) = (path.parent for path in (tmp_path / "kept").glob("*/session.json"))
    session.rename(tmp_path / "away")
    with pytest.raises(UnavailableError, match=r"^delete-person: .*object 1: nothing is deleted: ") as caught:
        await run(site, recordings="keep", for_good=True)
    assert "\n" not in str(caught.value)
    assert "if it has begun" not in str(caught.value)
    assert await numbers(site) == {1, 2}


async def hang_up(request: web.Request) -> web.Response:
    assert request.transport is not None
    request.transport.close()
    return web.Response()


async def test_a_connection_that_is_lost_leaves_open_whether_it_has_begun() -> None:
    app = web.Application()
    app.router.add_post("/api/operator/deletion", hang_up)
    async with TestServer(app) as server:
        with pytest.raises(UnavailableError, match=r"^delete-person: .*; if it has begun it is completed: "):
            await run_delete_person(
                str(server.make_url("/")), 1, "keep", None, None, for_good=True, as_json=False
            )


def test_a_server_that_is_away_is_a_temporary_failure(myview: RunCommand) -> None:
    ended = myview("delete-person", f"http://127.0.0.1:{free_port()}", "--object", 3)
    assert (ended.code, ended.out) == (3, "")
    assert ended.err.startswith("myview: delete-person: ")


def test_a_wrong_address_is_refused(myview: RunCommand) -> None:
    ended = myview("delete-person", "ftp://x", "--object", 3)
    assert input_error(ended) == "myview: delete-person: this is not an address like http://host:port"


def test_the_client_knows_every_field_of_the_answer() -> None:
    for mine, theirs in (
        (client.PersonDeletion, deletion_plan.PersonDeletion),
        (client_deletion.CameraLoss, deletion_plan.CameraLoss),
        (client_deletion.OtherLoss, deletion_plan.OtherLoss),
    ):
        assert {each.name for each in msgspec.structs.fields(mine)} == {
            each.name for each in msgspec.structs.fields(theirs)
        }
