"""`watch` goes with a person from one site to another, with the token only where it is accepted."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import msgspec
import pytest
from aiohttp import web

import client
from client.http import HttpSettings
from client.player import _at
from client.stream_events import ViewHistory
from fakes.http.scripted_server import OBJECTS, ScriptedSite, Serve, fragment, header, sse_event
from fakes.http.tokens import token_of
from fakes.timeouts import PATIENCE

TOKEN = token_of("desk")


def everybody(*, visible: bool, elsewhere: list[dict[str, Any]]) -> bytes:
    [person] = OBJECTS["objects"]
    return sse_event("objects", {"objects": [{**person, "visible": visible}], "elsewhere": elsewhere})


async def test_a_recording_goes_on_at_the_other_site_in_another_file(serve: Serve, tmp_path: Path) -> None:
    begun = asyncio.Event()

    async def at_yard(response: web.StreamResponse) -> None:
        await response.write(header() + b"".join(fragment(pulse) for pulse in range(100, 140)))
        await asyncio.Event().wait()

    yard = await serve(ScriptedSite([at_yard]))

    async def at_hall(response: web.StreamResponse) -> None:
        await response.write(header() + b"".join(fragment(pulse) for pulse in range(5000, 5010)))
        begun.set()
        for pulse in range(5010, 10**6):  # the picture stays that of the last camera
            await response.write(fragment(pulse))
            await asyncio.sleep(0.01)

    async def hall_events(response: web.StreamResponse) -> None:
        await response.write(everybody(visible=True, elsewhere=[]))
        await begun.wait()
        there = {"object": 1, "server": yard, "site": "yard", "visible": True}
        other_service = {"object": 1, "server": "http://nowhere/", "site": None}
        await response.write(everybody(visible=True, elsewhere=[other_service]))
        await response.write(everybody(visible=False, elsewhere=[other_service, there]))
        await asyncio.Event().wait()

    hall = await serve(ScriptedSite([at_hall], [hall_events]))
    async with asyncio.timeout(PATIENCE):
        result = await client.record(hall, 1, tmp_path / "one.mp4", seconds=1.5)
    assert result.out == tmp_path / "one.mp4"
    assert result.more_files == (tmp_path / "one-2.mp4",)
    assert b"picture 5009" in (tmp_path / "one.mp4").read_bytes()
    later = (tmp_path / "one-2.mp4").read_bytes()
    assert b"picture 100" in later
    assert b"picture 50" not in later
    assert result.complete
    assert result.seconds >= 1.4


@pytest.mark.parametrize(
    ("url", "place", "expected"),
    [
        ("http://hall/", {"server": "http://yard/"}, ("http://yard/", None)),
        ("http://hall/", {"server": "http://yard/", "token": True}, ("http://yard/", TOKEN)),
        ("https://hall/", {"server": "https://yard/", "token": True}, ("https://yard/", TOKEN)),
        ("https://hall/", {"server": "http://yard/", "token": True}, None),
        ("http://hall/", {"server": "nowhere://"}, None),
        ("http://hall/", {"server": None}, None),
    ],
)
def test_a_token_goes_along_only_to_a_site_that_accepts_it(
    url: str, place: dict[str, Any], expected: tuple[str, str | None] | None
) -> None:
    settings = HttpSettings(token=TOKEN, others=("http://hall-2/",))
    found = _at(client.PersonElsewhere(object=1, site="yard", visible=True, **place), url, settings)
    assert (None if found is None else (found[0], found[1].token)) == expected
    assert found is None or not found[1].others


def test_a_token_goes_along_into_another_area_of_the_same_site() -> None:
    place = client.PersonElsewhere(object=1, server="http://hall-2/", visible=True)
    found = _at(place, "http://hall/", HttpSettings(token=TOKEN))
    assert found is not None
    assert found[1].token == TOKEN


def test_whoever_was_merged_into_another_number_is_followed_by_that_one() -> None:
    history = ViewHistory(1)
    [person] = msgspec.convert(OBJECTS, client.Objects).objects
    there = client.PersonElsewhere(object=4, server="http://yard/", site="yard", visible=True)
    merged = msgspec.structs.replace(person, object=4, aliases=(1,), visible=True)
    history.take(client.Objects((merged,), (there,)))
    assert history.elsewhere is None
    history.take(client.Objects((), (there,)))
    assert history.elsewhere == there
