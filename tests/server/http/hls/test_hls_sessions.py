"""HLS players count as viewers while they wait for an answer, and for a while afterwards."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import ExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, SMALL
from server.http.access.permissions import ClientIdentity
from server.http.viewers.fair_share import FairShare
from server.http.viewers.hls_sessions import HlsClient, HlsSessions

KEPT_S = 6.0
PATHS = ["init.mp4", "index.m3u8", "0.m4s", "0.0.m4s"]


class Clock:
    """A clock that the test advances."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def make_client(stream: int, player: int = 0) -> HlsClient:
    return HlsClient(f"object {stream}", ClientIdentity("10.0.0.1"), "10.0.0.1", f"player {player}")


ACTS = st.lists(
    st.tuples(
        st.sampled_from(["request", "response", "wait"]),
        st.integers(0, 1),  # stream
        st.integers(0, 1),  # player
        st.sampled_from([None, "playlist", "part"]),
        st.integers(1, 4),  # seconds
    ),
    max_size=30,
)


@given(ACTS)
def test_players_that_fetched_recently_or_wait_are_counted(
    acts: list[tuple[str, int, int, str | None, int]],
) -> None:
    """Compare with a count over all requests so far."""
    clock = Clock()
    shares = FairShare()
    sessions = HlsSessions(KEPT_S / 3, shares, clock)
    last_request: dict[HlsClient, float] = {}
    open_ones: list[tuple[HlsClient, str | None, ExitStack]] = []

    def expected_count(client: HlsClient) -> int:
        waiting = [kind for hls_client, kind, _ in open_ones if hls_client == client]
        most = max((waiting.count(kind) for kind in ("playlist", "part")), default=0)
        is_recent = clock.now - last_request.get(client, -KEPT_S) < KEPT_S
        return max(most, 1 if is_recent else 0)

    for act, stream, player, kind, seconds in acts:
        hls_client = make_client(stream, player)
        if act == "request":
            before, one_more = sessions.of(hls_client.stream), sessions.is_new_viewer(hls_client, kind)
            stack = ExitStack()
            stack.enter_context(sessions.request(hls_client, kind))
            open_ones.append((hls_client, kind, stack))
            last_request[hls_client] = clock.now
            assert sessions.of(hls_client.stream) - before == one_more
        elif act == "response" and open_ones:
            hls_client, _, stack = open_ones.pop(0)
            stack.close()
            last_request[hls_client] = clock.now
        else:
            clock.now += seconds
        # requests without a part number are answered at once; here all block
        all_clients = [make_client(one, other) for one in (0, 1) for other in (0, 1)]
        assert [sessions.of(f"object {number}") for number in (0, 1)] == [
            sum(
                expected_count(hls_client)
                for hls_client in all_clients
                if hls_client.stream == f"object {number}"
            )
            for number in (0, 1)
        ]
        assert sessions.all == shares.all == sum(map(expected_count, all_clients))
    for _, _, stack in open_ones:
        stack.close()
    clock.now += KEPT_S
    assert sessions.all == 0
    assert not sessions._sessions
    assert not sessions._by_stream
    assert not shares._held


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    """A limit of two viewers; two people whose first segment is complete."""
    async for served in serve_site(http={"viewers_max": 2, "hls_segment_s": 0.4}):
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(5):
            served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {}})
        yield served


async def status(served: ServedSite, path: str, player: str) -> int:
    async with served.session.get(path, headers={"User-Agent": player}) as answer:
        if answer.status == 503:
            assert int(answer.headers["Retry-After"]) > 0
            assert "viewers_max" in (await answer.json())["error"]
        return answer.status


async def viewers_in_metrics(served: ServedSite) -> float:
    async with served.session.get("/metrics") as answer:
        text = await answer.text()
    return float(next(line for line in text.splitlines() if line.startswith("myview_viewers ")).split()[1])


@pytest.mark.parametrize("path", PATHS)
async def test_hls_players_take_slots_and_one_more_gets_503(served: ServedSite, path: str) -> None:
    for player in ("one", "two", "one", "two"):
        assert await status(served, f"/objects/1/hls/{path}", player) == 200
    assert await viewers_in_metrics(served) == 2
    assert await status(served, f"/objects/1/hls/{path}", "three") == 503
    assert await status(served, "/objects/2/hls/index.m3u8", "one") == 503, (
        "another stream needs another slot"
    )
    async with served.session.get("/objects/1/best.mp4") as answer:
        assert answer.status == 503
    for other in PATHS:
        assert await status(served, f"/objects/1/hls/{other}", "two") == 200, "existing viewers continue"


async def test_connected_viewers_reduce_the_slots_for_hls_players(served: ServedSite) -> None:
    async with served.session.get("/objects/2/best.mp4"):
        assert await status(served, "/cameras/c0/hls/index.m3u8", "one") == 200
        assert await status(served, "/cameras/c0/hls/index.m3u8", "two") == 503
        assert await viewers_in_metrics(served) == 2


async def test_head_takes_no_slot(served: ServedSite) -> None:
    for path in PATHS:
        async with served.session.head(f"/objects/1/hls/{path}") as answer:
            assert answer.status == 200
    assert await viewers_in_metrics(served) == 0


async def test_blocked_players_of_one_address_and_user_agent_are_counted_separately(
    served: ServedSite,
) -> None:
    future_playlist = "/objects/1/hls/index.m3u8?_HLS_msn=3"
    waiting = [asyncio.create_task(status(served, future_playlist, "same")) for _ in range(2)]
    while await viewers_in_metrics(served) < 2:  # noqa: ASYNC110 — they arrive one after the other
        await asyncio.sleep(0.005)
    assert await status(served, future_playlist, "same") == 503
    assert await status(served, "/objects/1/hls/index.m3u8", "other") == 503
    assert not any(task.done() for task in waiting)
    for epoch in range(5, 16):
        served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {}})
    assert await asyncio.gather(*waiting) == [200, 200]
    assert await viewers_in_metrics(served) == 1, "they are indistinguishable now"


async def test_the_viewer_limit_of_one_stream_includes_hls_players() -> None:
    async for served in serve_site(http={"viewers_per_object": 1, "hls_segment_s": 0.4}):
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(5):
            served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {}})
        async with served.session.get("/objects/1/best.ts"):
            assert (await served.get("/objects/1/hls/index.m3u8"))[0] == 503
            async with served.session.get("/objects/2/hls/index.m3u8") as answer:
                assert answer.status == 200
            async with served.session.get("/objects/2/best.mp4") as answer:
                assert answer.status == 503
                assert "viewers_per_object" in (await answer.json())["error"]
