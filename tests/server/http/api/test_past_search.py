"""``/api/past/search``: stays in zones, pictures and anywhere; scopes of tokens; invalid queries."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from random import Random
from typing import Any
from urllib.parse import quote

import aiohttp
import pytest

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.service.fed_site import ServedSite, serve_site, show_people
from fakes.service.scripted_cameras import CAMERAS
from fakes.service.scripted_recordings import PULSE0, UNLIMITED, gop_record, written_folder
from server.messaging.messages import Box
from server.service.facade import past_search
from server.service.past_search import worker
from server.service.past_search.search import search
from server.service.past_search.worker import SearchTask, StaySearchResult
from server.service.recording.recording_folder import RecordingFolder

A, B = CAMERAS
LEFT: Box = (2.0, 10.0, 8.0, 28.0)
MIDDLE: Box = (22.0, 10.0, 28.0, 28.0)
RIGHT: Box = (50.0, 10.0, 56.0, 28.0)
IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.001, 1.0]]
ZONES = [
    {"id": "right", "camera": "c0", "area": [[32, 0], [64, 0], [64, 48], [32, 48]]},
    {"id": "floor", "area": [[32, 0], [64, 0], [64, 48], [32, 48]]},
    {"id": "door", "line": [[0, 0], [1, 0]], "inner": [0, 1]},
]
EPOCHS = 20
"""Person 1 is left for ten GOPs of 0.2 s, then right; person 2 is in c1 in the first eight."""


async def search_here(task: SearchTask) -> StaySearchResult:
    """Search without another process, whose start takes most of the time."""
    return search(task)


@pytest.fixture
async def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[ServedSite]:
    monkeypatch.setattr(past_search, "run_search", search_here)
    cameras = [{"id": camera, "source": "x.mp4", "ground": IDENTITY} for camera in CAMERAS]
    record = {"folder": str(tmp_path / "kept"), "segment_s": 1.0}
    async with serve_with_tokens(tmp_path, zones=ZONES, cameras=cameras, record=record) as served:
        served.service.frames = EPOCHS * 5
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(EPOCHS):
            box = LEFT if epoch < EPOCHS // 2 else RIGHT
            served.service.feed(epoch, {A: {1: box}, B: {1: None, 2: MIDDLE if epoch < 8 else None}})
        served.service.decider.people.registry.names = {1: "Ann"}
        yield served


async def ask(site: ServedSite, query: str, token: str = "desk") -> tuple[int, dict[str, Any]]:  # noqa: S107
    async with site.session.get(f"/api/past/search{query}", headers=bearer(token)) as answer:
        return answer.status, await answer.json()


def stays(content: dict[str, Any]) -> list[tuple[int, str | None, int, int]]:
    return [
        (stay["object"], stay["zone"] or stay["camera"], stay["first"], stay["frames"])
        for stay in content["stays"]
    ]


async def test_who_was_in_a_zone_and_where_a_person_went(site: ServedSite) -> None:
    decided = site.service.decision_state.end
    half = EPOCHS // 2 * 5
    _, in_zone = await ask(site, "?from=p0&zone=right")
    assert stays(in_zone) == [(1, "right", half, decided - half)]
    assert (in_zone["zones"], in_zone["placed_by"], in_zone["next"]) == (["right"], [], None)
    _, went = await ask(site, "?from=p0&object=1&zone=*&camera=*&gap_s=0")
    assert sorted(stays(went), key=str) == [
        (1, "c0", 0, decided),
        (1, "floor", half, decided - half),
        (1, "right", half, decided - half),
    ]
    assert went["placed_by"] == ["c0", "c1"]
    ((ann, *_), people) = (went["stays"], went["people"])
    assert (ann["name"], ann["cameras"], ann["clip"]) == (
        "Ann",
        ["c0"],
        f"objects/1/best.mp4?from=p0&to=p{decided}",
    )
    assert [(person["object"], person["first"], person["frames"]) for person in people] == [(1, 0, decided)]
    _, longest = await ask(site, f"?from=p0&to=p{half}&order=longest&limit=1")
    assert (stays(longest), longest["found"]) == ([(1, None, 0, half)], 2)
    _, short = await ask(site, "?from=p0&camera=c1&min_s=3")
    assert stays(short) == []


async def test_a_search_of_many_files_continues(site: ServedSite, monkeypatch: pytest.MonkeyPatch) -> None:
    while site.service.recorder.writer is not None and site.service.recorder.writer.written < 15:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    monkeypatch.setattr(past_search, "_FILES_MAX", 1)
    start, answers = 0, 0
    while True:
        _, content = await ask(site, f"?from=p{start}&min_s=0&object=1")
        ((number, _, first, frames),) = stays(content)
        assert (number, first) == (1, -(-start // 10) * 10), "each pulse is searched once"
        answers += 1
        if content["next"] is None:
            break
        start = content["next"]
    assert first + frames == site.service.decision_state.end
    assert answers > 2


async def test_a_search_runs_in_another_process(site: ServedSite, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = await ask(site, "?from=p0&zone=floor")
    monkeypatch.setattr(past_search, "run_search", worker.run_search)
    assert await ask(site, "?from=p0&zone=floor") == expected
    monkeypatch.setattr(worker, "SEARCH_TIMEOUT_S", 0.0)
    assert await ask(site, "?from=p0") == (
        503,
        {"error": "searching the past: the recording was not read within 0 s"},
    )


async def test_a_token_for_one_person_finds_only_them(site: ServedSite) -> None:
    _, own = await ask(site, "?from=p0&zone=right", "family")
    assert {number for number, *_ in stays(own)} == {1}
    _, anywhere = await ask(site, "?from=p0", "family")
    assert {person["object"] for person in anywhere["people"]} == {1}
    code, content = await ask(site, "?from=p0&object=2", "family")
    assert (code, content["error"]) == (403, "object: this token is for watching object 1")
    code, content = await ask(site, "?from=p0&zone=none", "family")
    assert (code, content["error"]) == (400, "zone: 'none': there is no such area")


async def test_a_token_for_one_camera_finds_who_it_saw_without_names(site: ServedSite) -> None:
    _, seen = await ask(site, "?from=p0", "door")
    assert [(stay["object"], stay["name"], stay["clip"].split("?")[0]) for stay in seen["stays"]] == [
        (1, None, "cameras/c0/live.mp4")
    ]
    for query in ("?from=p0&zone=right", "?from=p0&camera=c1", "?from=p0&camera=*"):
        assert (await ask(site, query, "door"))[0] == 403


INVALID = [
    ("", 400, "from: is missing"),
    ("?from=x", 400, "from: 'x' is not a time"),
    ("?from=p9&to=p3", 400, "to: p3 is not after from"),
    ("?from=p0&zone=attic", 400, "zone: 'attic': there is no such area; there are right, floor"),
    ("?from=p0&zone=door", 400, "zone: 'door': is a line, in which no one stays"),
    ("?from=p0&zone=", 400, "zone: is empty"),
    (
        "?from=p0&zone=floor",
        409,
        "zone: floor is on the floor, and no calibrated camera has sent pictures yet",
    ),
    ("?from=p0&camera=c9", 404, "there is no camera 'c9'; there are c0, c1"),
    ("?from=p0&object=one", 400, "object=one: must be a whole number"),
    ("?from=p0&limit=0", 400, "limit=0: must be a whole number from 1 to 1000"),
    ("?from=p0&min_s=nan", 400, "min_s=nan: must be seconds from 0 to 86400"),
    ("?from=p0&gap_s=1e9", 400, "gap_s=1e9: must be seconds"),
    ("?from=p0&order=best", 400, "order=best: must be one of time, newest, longest"),
    ("?from=p0&zones=right", 400, "zones: there is no such parameter"),
    ("?from=p0&zone=right&zone=floor", 400, "zone: is given more than once"),
]
VALUES = {
    "from": ("p0", "-60", "p9999999999999", "0001-01-01", "9999-12-31T23:59:59-23:59"),
    "to": ("p20", "-1", "p9999999999999"),
    "zone": ("right", "floor", "door", "*"),
    "camera": ("c0", "*"),
    "object": ("1", "999999999"),
    "min_s": ("0", "86400"),
    "gap_s": ("0", "0.04"),
    "order": ("longest", "newest"),
    "limit": ("1", "1000"),
}


@pytest.fixture
async def open_site(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[ServedSite]:
    """A site without tokens that keeps decisions in memory only."""
    monkeypatch.setattr(past_search, "run_search", search_here)
    async for served in serve_site(zones=ZONES):
        yield served


async def test_an_invalid_search_is_refused_with_one_line(open_site: ServedSite) -> None:
    for query, code, error in INVALID:
        found, content = await open_site.get(f"/api/past/search{query}")
        assert (found, content["error"][: len(error)]) == (code, error), query


async def test_no_query_of_a_search_fails(open_site: ServedSite) -> None:
    assert stays(await open_site.get_json("/api/past/search?from=-60")) == [], "nothing has been seen yet"
    show_people(open_site)
    assert len(stays(await open_site.get_json("/api/past/search?from=-60&min_s=0"))) == 2
    rng = Random(5)
    for _ in range(150):
        chosen = {name: rng.choice(values) for name, values in VALUES.items() if rng.random() < 0.5}
        for name in rng.sample(sorted(chosen), min(len(chosen), rng.randrange(2))):
            chosen[name] = "".join(
                chr(rng.choice((37, 42, 46, 48, 112, 1632, 0x1F600, 0))) for _ in range(rng.randrange(9))
            )
        query = "&".join(f"{name}={quote(value)}" for name, value in chosen.items())
        code, content = await open_site.get(f"/api/past/search?{query}")
        assert code in {200, 400, 404, 409}, query
        assert code == 200 or "\n" not in content["error"]


class Waiting:
    """Searches that wait until they are released."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.running = self.most = 0
        self.go_on = asyncio.Event()
        monkeypatch.setattr(past_search, "run_search", self.search)

    async def search(self, task: SearchTask) -> StaySearchResult:
        self.running += 1
        self.most = max(self.most, self.running)
        try:
            await self.go_on.wait()
        finally:
            self.running -= 1
        return search(task)


async def test_searches_are_made_one_by_one_and_few_wait(
    open_site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting = Waiting(monkeypatch)
    many = [asyncio.create_task(open_site.get("/api/past/search?from=-9")) for _ in range(12)]
    refused = 0
    for done in asyncio.as_completed(many):
        code, content = await done
        if code == 503:
            assert content["error"].startswith("too many searches of the past wait")
            refused += 1
            if refused == 4:
                waiting.go_on.set()
    assert (waiting.most, refused) == (1, 4)


async def test_searches_of_one_token_make_way_for_those_of_another(
    site: ServedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting = Waiting(monkeypatch)
    many = [asyncio.create_task(ask(site, "?from=p0")) for _ in range(9)]
    done, many_left = await asyncio.wait(many, return_when=asyncio.FIRST_COMPLETED)
    assert [task.result()[0] for task in done] == [503]
    other = asyncio.create_task(ask(site, "?from=p0", "family"))
    evicted, left = await asyncio.wait(many_left, return_when=asyncio.FIRST_COMPLETED)
    (one,) = evicted
    # The connection was reset; aiohttp asks again where it had been used before.
    assert isinstance(one.exception(), aiohttp.ClientError) or one.result()[0] == 503
    waiting.go_on.set()
    assert (await other)[0] == 200
    assert {(await task)[0] for task in left} == {200}


async def test_people_of_an_earlier_run_are_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(past_search, "run_search", search_here)
    earlier = [gop_record(gop, {1: A}) for gop in range(4)]
    written_folder(RecordingFolder(tmp_path / "kept", UNLIMITED), earlier).close()
    async for served in serve_site(record={"folder": str(tmp_path / "kept")}):
        served.service.pulses.pulse0 = PULSE0
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(5, 8):
            served.service.feed(epoch, {A: {1: LEFT}, B: {}})
        found = (await served.get_json("/api/past/search?from=p0&min_s=0&order=longest"))["stays"]
        (folder,) = served.service.recorder.folder.earlier  # type: ignore[union-attr]
        assert [(stay["object"], stay["run"], stay["first"], stay["frames"]) for stay in found] == [
            (1, folder.folder.name, 0, 20),
            (1, None, 30, 5),
        ]
        assert [stay["clip"] for stay in found] == [
            "cameras/c0/live.mp4?from=p0&to=p20",
            "objects/1/best.mp4?from=p30&to=p35",
        ]
        own = (await served.get_json("/api/past/search?from=p0&min_s=0&object=1"))["stays"]
        assert [stay["run"] for stay in own] == [None]
