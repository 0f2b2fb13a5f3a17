"""Shards: several best-view services of a site together decide as a single one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator, Sequence
from typing import Any

import aiohttp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentityUpdate, Merge, TrackletKey, TrackUpdate
from fakes.service.scripted_cameras import (
    CAMERAS,
    LARGE,
    SMALL,
    FedService,
    TrackNumbers,
    camera_tracks,
    encoded,
    epoch_of,
    small_config,
    tracks,
    video,
)
from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.config.sections import HttpSettings, ShardingSettings
from server.http.app import make_app, serving
from server.messaging.bus import Bus
from server.messaging.messages import Box, ZenohKeys
from server.service.identity.sharding import ShardingByNumber, shard_address
from server.service.pipeline import BestViewPipeline
from server.service.service import BestViewService
from server.service.view_selection.decider import ViewDecider
from server.system.errors import UserError


def shard_settings(index: int, of: int = 2, **more: Any) -> dict[str, Any]:
    return {"view": {"sharding": {"of": of, "index": index, **more}}}


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_shards_together_decide_as_a_single_service(of: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    deciders = [
        ViewDecider(
            small_config(**shard_settings(index, of)), dict.fromkeys(CAMERAS), lambda _camera, _pulse: True
        )
        for index in range(of)
    ]
    single_decider = ViewDecider(small_config(), dict.fromkeys(CAMERAS), lambda _camera, _pulse: True)
    for view_decider in [*deciders, single_decider]:
        view_decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    for number in range(6):
        messages = []
        for camera in CAMERAS:
            size = {track: float(rng.uniform(5, 40)) for track in range(1, 8) if rng.random() < 0.7}
            boxes: dict[int, Box | None] = {number: (0.0, 0.0, s / 2, s) for number, s in size.items()}
            messages.append(camera_tracks(camera, number, boxes))
        epoch = epoch_of(number, *messages)
        answers = [decider.step(epoch) for decider in deciders]
        for place, single in enumerate(single_decider.step(epoch)):
            parts = [answer[place] for answer in answers]
            together = [choice for part in parts for choice in part.choices]
            assert sorted(together, key=lambda choice: choice.number) == list(single.choices)
            assert all(part.boxes == single.boxes for part in parts)
            for index, part in enumerate(parts):
                assert all(choice.number % of == index for choice in part.choices)


def test_viewers_of_a_merged_number_stay_at_their_service() -> None:
    people = ShardingByNumber(ShardingSettings(of=3, index=2))
    assert people.own([1, 2, 4, 5], {}) == [2, 5]
    assert people.own([1, 4], {5: 4}) == [4]
    assert people.own([1, 2], {8: 7}) == [2]
    assert people.others([1, 4, 7], {5: 4}) == [1, 7]
    assert [people.shard_of(number) for number in (3, 4, 5)] == [0, 1, 2]


def test_a_merged_numbers_stream_continues_at_its_own_service() -> None:
    class MergingRegistry:
        """An identity registry that merges two people."""

        next_id = 3

        def reserve_below(self, number: int) -> None:
            """Ignore the reservation."""

        def update(self, updates: Sequence[TrackUpdate], last_frame: int, _: object) -> IdentityUpdate:
            if last_frame < 15:
                return IdentityUpdate(
                    {TrackletKey(*track.key, 0): track.local_id for track in updates}, (), (), (), (), ()
                )
            merged = (Merge(1, 2),) if last_frame < 20 else ()
            numbers = dict.fromkeys((TrackletKey("c0", 1, 0), TrackletKey("c0", 2, 0)), 1)
            return IdentityUpdate(numbers, (), (), (), merged, ())

    service = FedService(small_config(**shard_settings(0)))
    service.decider.people._registry = MergingRegistry()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    for epoch in range(6):
        service.feed(epoch, {"c0": {1: SMALL, 2: LARGE}, "c1": {}})
        if epoch == 2:
            service.splicer.persons[2].subscribe()
    assert service.decision_state.resolve(2) == 1
    assert list(service.decision_state.selected_views) == [1]
    assert service.decider.people.of_other_shards == []
    assert set(service.splicer.persons) == {1, 2}
    service.close()


@pytest.mark.parametrize(
    ("sharding", "reason"),
    [
        ({"of": 2, "index": 2}, "index is 2, but of 2 services the last is 1"),
        ({"of": 2, "servers": ["http://a/"]}, "servers names 1, but there are 2 shards"),
        ({"of": 1, "servers": ["nowhere"]}, "servers.0: is not an address"),
        ({"of": 0}, "view.sharding.of"),
    ],
)
def test_an_invalid_division_is_refused_in_one_line(sharding: dict[str, Any], reason: str) -> None:
    with pytest.raises(UserError, match="sharding") as refusal:
        small_config(view={"sharding": sharding})
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_shard_addresses_are_normalized_to_base_urls() -> None:
    sharding = ShardingSettings(of=2, servers=["http://a:1", "https://b/myview/"])
    assert (shard_address(0, sharding), shard_address(1, sharding)) == ("http://a:1/", "https://b/myview/")
    assert shard_address(1, ShardingSettings(of=2)) is None


@pytest.fixture(params=[["http://one:1/", "http://two/x"], []])
async def second_service(request: pytest.FixtureRequest) -> AsyncIterator[str]:
    """Serve the second of two shards, with and without configured addresses."""
    service = FedService(small_config(**shard_settings(1, servers=request.param)))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    for epoch in range(4):
        service.feed(epoch, {"c0": {1: SMALL, 2: LARGE, 3: SMALL}, "c1": {1: LARGE}})
    async with serving(make_app(BestViewService(service)), HttpSettings(port=0)) as port:
        yield f"http://127.0.0.1:{port}"
    service.close()


async def test_people_of_another_service_are_listed_and_redirected(
    second_service: str, request: pytest.FixtureRequest
) -> None:
    has_address = bool(request.node.callspec.params["second_service"])
    async with aiohttp.ClientSession() as session:

        async def get(path: str) -> tuple[int, str | None, Any]:
            async with session.get(second_service + path, allow_redirects=False) as answer:
                content = await answer.json() if answer.content_type == "application/json" else None
                return answer.status, answer.headers.get("Location"), content

        _, _, objects = await get("/api/objects")
        assert [person["object"] for person in objects["objects"]] == [1, 3]
        server = "http://one:1/" if has_address else None
        own_site = {"site": None, "visible": None, "token": False}
        assert objects["elsewhere"] == [{"object": 2, "server": server, **own_site}]
        assert (await get("/api/objects/1/choice"))[0] == 200
        for path in ("objects/2/best.mp4?a=b", "api/objects/2/choice", "objects/2/thumb.jpg"):
            status, location, content = await get(f"/{path}")
            if has_address:
                assert (status, location) == (307, f"http://one:1/{path}")
            else:
                assert status == 404
                assert "served by best-view service 0" in content["error"]
        assert (await get("/api/cameras"))[0] == 200


@pytest.fixture
def pair() -> Iterator[list[BestViewPipeline]]:
    """Two services of one site on a private bus."""
    routers = [f"tcp/127.0.0.1:{free_port()}" for _ in range(2)]
    services = [
        BestViewPipeline(
            small_config(**shard_settings(index), zenoh={"listen": routers[index], "connect": routers})
        )
        for index in range(2)
    ]
    for service in services:
        service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    yield services
    for service in reversed(services):
        service.close()


async def test_both_services_receive_all_cameras_and_publish_under_their_keys(
    pair: list[BestViewPipeline],
) -> None:
    for service in pair:
        service.open_bus()
    keys, camera = ZenohKeys("hall"), Bus.client(pair[0].config.zenoh)
    alive, published = KeyRecorder(), KeyRecorder()
    try:
        camera.watch_alive(keys.bestview("**/alive"), lambda key, _: alive.add(key))
        camera.subscribe(keys.bestview("**/choices"), lambda message: published.add(message.key))
        await alive.all_of("myview/hall/bestview/alive", "myview/hall/bestview/1/alive")
        camera.declare_alive(keys.camera("c0", "alive"))
        camera.declare_alive(keys.camera("c1", "alive"))
        sending = asyncio.create_task(send(camera, pair))
        await published.all_of("myview/hall/bestview/choices", "myview/hall/bestview/1/choices")
        sending.cancel()
        assert [list(service.decision_state.selected_views) for service in pair] == [[2], [1]]
    finally:
        camera.close()


async def send(camera: Bus, services: Sequence[BestViewPipeline]) -> None:
    """Send epochs until cancelled: those before a subscription is active are lost."""
    for epoch in range(1000):
        for name in CAMERAS:
            for unit in encoded(0)[5 * (epoch % 8) : 5 * (epoch % 8) + 5]:
                message = video(name, unit)
                camera.publish(message.key, message.payload, message.attachment)
            track_message = tracks(camera_tracks(name, epoch, {1: SMALL, 2: LARGE}))
            camera.publish(track_message.key, track_message.payload)
        await asyncio.sleep(0.02)
        for service in services:
            service.decide()


class KeyRecorder:
    """Records keys."""

    def __init__(self) -> None:
        self._keys: set[str] = set()
        self._more = asyncio.Event()

    def add(self, key: str) -> None:
        self._keys.add(key)
        self._more.set()

    async def all_of(self, *keys: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while not set(keys) <= self._keys:
                self._more.clear()
                await self._more.wait()
