"""Fair shares: a client with fewer streams gets a slot of the client with the most."""

from __future__ import annotations

from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.http.tokens import TOKEN_ENTRIES, bearer, serve_with_tokens, token_entry, write_tokens
from fakes.service.drawn_site import drawn_room
from fakes.service.fed_site import ServedSite, serve_site, show_people
from server.http.access.permissions import ClientIdentity
from server.http.viewers.fair_share import FairShare, Slot

DOOR = "/cameras/c0/hls/index.m3u8"
"""The stream that the most limited token may watch."""


class Viewer:
    """A client that watches or receives events until its slot is evicted."""

    def __init__(self, answer: aiohttp.ClientResponse) -> None:
        self._answer = answer

    async def wait_for_end(self) -> None:
        """Wait until the server ends it."""
        ended = False
        while not ended:
            try:
                ended = not await self._answer.content.read(1 << 16)
            except (aiohttp.ClientError, ConnectionResetError):
                ended = True

    @property
    def is_open(self) -> bool:
        return not self._answer.content.at_eof() and self._answer.content.exception() is None


@asynccontextmanager
async def site(folder: Path, **http: Any) -> AsyncIterator[ServedSite]:
    async with serve_with_tokens(folder, http={"hls_segment_s": 0.4, **http}) as served:
        show_people(served)
        for epoch in (3, 4):
            served.service.feed(epoch, {"c0": {}, "c1": {}})
        yield served


async def fetch_status(served: ServedSite, path: str, name: str, player: str) -> int:
    async with served.session.get(path, headers={**bearer(name), "User-Agent": player}) as answer:
        return answer.status


async def open_viewer(stack: AsyncExitStack, served: ServedSite, path: str, **heads: str) -> Viewer | int:
    """Open a stream or events until the stack closes; return the status if refused."""
    session = await stack.enter_async_context(aiohttp.ClientSession(f"http://127.0.0.1:{served.port}"))
    answer = await session.get(path, headers=heads)
    stack.callback(answer.close)
    return Viewer(answer) if answer.status == 200 else answer.status


async def test_a_token_with_many_players_does_not_take_others_streams(tmp_path: Path) -> None:
    async with site(tmp_path, viewers_max=20) as served:
        flood = [await fetch_status(served, DOOR, "door", f"player {number}") for number in range(40)]
        assert flood == [200] * 20 + [503] * 20
        for name in ("desk", "family", "lead"):
            path = "/objects/1/hls/index.m3u8"
            assert [await fetch_status(served, path, name, f"{name} {number}") for number in range(3)] == [
                200
            ] * 3, name
        assert await fetch_status(served, DOOR, "door", "player 0") == 200, "the oldest connection stays"
        assert await fetch_status(served, DOOR, "door", "player 19") == 503, "the newest was evicted"
        for name in ("desk", "family", "lead"):
            assert await fetch_status(served, "/objects/1/hls/index.m3u8", name, f"{name} 0") == 200, (
                "and continues"
            )


@pytest.mark.parametrize(
    ("path", "bound"),
    [
        ("/cameras/c0/live.ts", "viewers_max"),
        ("/cameras/c0/live.ts", "viewers_per_object"),
        ("/cameras/c0/live.mp4?from=-1", "viewers_max"),
        ("/api/events", "viewers_max"),
    ],
)
async def test_a_token_with_many_connections_does_not_take_others_streams(
    tmp_path: Path, path: str, bound: str
) -> None:
    async with site(tmp_path, **{bound: 3}) as served, AsyncExitStack() as stack:
        door, desk, lead = bearer("door"), bearer("desk"), bearer("lead")
        flood = [await open_viewer(stack, served, path, **door) for _ in range(4)]
        *held, newest, refused = flood
        assert refused == 503
        assert isinstance(newest, Viewer)
        async with served.session.head(path, headers=desk) as answer:
            assert answer.status == 503, "a refused request evicts none"
        desk_viewer = await open_viewer(stack, served, path, **desk)
        assert isinstance(desk_viewer, Viewer)
        await newest.wait_for_end()
        assert await open_viewer(stack, served, path, **desk) == 503, "more than the others' share"
        assert await open_viewer(stack, served, path, **door) == 503
        for _ in range(3):
            assert isinstance(await open_viewer(stack, served, path, **lead), Viewer), (
                "operators are always admitted"
            )
        assert await open_viewer(stack, served, path, **lead) == 503, "but not in place of each other"
        for viewer in (*held, desk_viewer):
            assert isinstance(viewer, Viewer)
            await viewer.wait_for_end()


async def test_a_stream_that_has_caught_up_can_be_evicted_like_live_ones(tmp_path: Path) -> None:
    async with site(tmp_path, viewers_per_object=2) as served, AsyncExitStack() as stack:
        flood = [
            await open_viewer(stack, served, "/cameras/c0/live.mp4?from=-1", **bearer("door"))
            for _ in range(2)
        ]
        broadcaster = served.service.splicer.cameras["c0"]
        while broadcaster.viewers < 2:
            await served.get("/healthz", "HEAD")
        assert isinstance(await open_viewer(stack, served, "/cameras/c0/live.ts", **bearer("desk")), Viewer)
        assert isinstance(flood[1], Viewer)
        await flood[1].wait_for_end()


async def test_without_tokens_shares_are_by_address_and_this_machine_operates() -> None:
    async for served in serve_site(http={"viewers_max": 2}):
        show_people(served)
        async with AsyncExitStack() as stack:
            elsewhere = {"X-Forwarded-For": "10.0.0.7"}
            flood = [await open_viewer(stack, served, "/objects/1/best.ts", **elsewhere) for _ in range(3)]
            assert flood[2] == 503
            assert isinstance(await open_viewer(stack, served, "/objects/1/best.ts"), Viewer)
            assert isinstance(flood[1], Viewer)
            await flood[1].wait_for_end()
            assert isinstance(flood[0], Viewer)
            assert flood[0].is_open


async def test_a_token_with_many_rendered_streams_does_not_take_others_streams(tmp_path: Path) -> None:
    tokens = write_tokens(tmp_path / "tokens.yaml", *map(token_entry, TOKEN_ENTRIES))
    door, desk, lead = bearer("door"), bearer("desk"), bearer("lead")
    async for drawn in drawn_room(access={"tokens": str(tokens)}, http={"pictures_max": 3}):
        async with AsyncExitStack() as stack:
            paths = ("/cameras/c1/live.mjpeg?overlay=1", "/cameras/c0/live.mjpeg", "/cameras/c1/live.mjpeg")
            held = [await open_viewer(stack, drawn, path, **desk) for path in paths]
            overlaid = "/cameras/c0/live.mjpeg?overlay=1"
            assert await open_viewer(stack, drawn, overlaid, **desk) == 503
            door_viewer = await open_viewer(stack, drawn, overlaid, **door)
            assert isinstance(door_viewer, Viewer), "a place of the token that has the most"
            assert isinstance(held[2], Viewer)
            await held[2].wait_for_end()
            assert await open_viewer(stack, drawn, paths[2], **desk) == 503, "more than the others' share"
            for path in ("/cameras/c1/live.jpg", "/objects/1/best.jpg"):
                async with drawn.session.get(path, headers=lead) as answer:
                    assert answer.status == 200, "operators are always admitted"
            assert isinstance(held[1], Viewer)
            await held[1].wait_for_end()
            assert isinstance(held[0], Viewer)
            assert held[0].is_open
            assert door_viewer.is_open


CLIENTS = [*map(ClientIdentity, "abc"), ClientIdentity("o", is_operator=True)]


@given(st.lists(st.tuples(st.sampled_from(CLIENTS), st.sampled_from("xy"), st.integers(1, 2)), max_size=40))
def test_shares_become_equal_and_stay_equal(arrivals: list[tuple[ClientIdentity, str, int]]) -> None:
    shares, limit, slots = FairShare(), 6, dict[Slot, None]()

    def release(slot: Slot) -> None:
        del slots[slot]
        shares.release(slot)

    for holder, stream, weight in arrivals:
        before = Counter(
            {client.key: sum(p.weight for p in slots if p.client == client) for client in CLIENTS}
        )

        slot = Slot(holder, stream, lambda: None, weight)
        slot.end = partial(release, slot)
        if shares.all >= limit and not shares.evict_for(holder):
            of_others = {key: count for key, count in before.items() if key != holder.key}
            watching = {key: count for key, count in of_others.items() if key != "o"}
            if holder.is_operator:
                assert not any(watching.values())
            assert all(count <= before[holder.key] + 1 for count in watching.values())
            continue
        slots[slot] = None
        shares.take(slot)
        after = Counter(
            {client.key: sum(p.weight for p in slots if p.client == client) for client in CLIENTS}
        )
        lost = [key for key in before if after[key] < before[key]]
        assert "o" not in lost
        assert len(lost) <= 1
        if lost and not holder.is_operator:
            assert (
                before[lost[0]]
                == max(before[key] for key in "abc" if key != holder.key)
                > before[holder.key] + 1
            )
    assert shares.all == sum(slot.weight for slot in slots)
    assert not shares.ending()


@given(st.lists(st.tuples(st.sampled_from(CLIENTS), st.integers(0, 5)), max_size=40))
def test_shares_of_rendered_streams_become_equal_and_stay_equal(
    arrivals: list[tuple[ClientIdentity, int]],
) -> None:
    shares, limit, slots = FairShare(), 4, dict[Slot, None]()

    def holders() -> dict[str, str]:
        found: dict[str, str] = {}
        for slot in slots:
            found.setdefault(slot.stream, slot.client.key)
        return found

    def release(slot: Slot) -> None:
        del slots[slot]
        shares.release(slot)

    for client, number in arrivals:
        before = holders()
        counts = Counter(before.values())
        if str(number) not in before and len(before) >= limit and not shares.evict_stream_for(client):
            others = [count for key, count in counts.items() if key not in {client.key, "o"}]
            assert not others if client.is_operator else max(others, default=0) <= counts[client.key] + 1
            continue
        lost = [before[stream] for stream in before.keys() - holders().keys()]
        assert len(lost) <= 1
        assert "o" not in lost
        if lost and not client.is_operator:
            assert counts[lost[0]] == max(counts[key] for key in "abc" if key != client.key)
            assert counts[lost[0]] > counts[client.key] + 1
        slot = Slot(client, str(number), lambda: None)
        slot.end = partial(release, slot)
        slots[slot] = None
        shares.take(slot)
        assert len(holders()) <= limit


def test_the_limit_of_one_stream_evicts_only_its_viewers() -> None:
    shares = FairShare()
    ended: list[str] = []
    for stream in "xxxyy":
        shares.take(Slot(CLIENTS[0], stream, lambda stream=stream: ended.append(stream)))  # type: ignore[misc]
    assert shares.evict_for(CLIENTS[1], ["y"])
    assert (ended, shares.ending("y"), shares.ending("x"), shares.ending()) == (["y"], 1, 0, 1)
    assert not shares.evict_for(CLIENTS[1], ["y"])
    assert shares.evict_for(CLIENTS[1])
    assert ended == ["y", "y"]
