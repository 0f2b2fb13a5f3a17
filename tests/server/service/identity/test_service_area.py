"""Who is in a service's area is decided for there; who is far from it is not taken in."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Sequence
from typing import Any

import aiohttp
import msgspec
import numpy as np
import pytest

from fakes.service.scripted_cameras import CAMERAS, SMALL, FedService, camera_tracks, epoch_of, small_config
from fakes.timeouts import PATIENCE
from server.config.sections import HttpSettings, ShardingSettings
from server.config.site_config import Config
from server.http.api.responses import objects_info
from server.http.app import make_app, serving
from server.messaging.messages import CameraTracks
from server.messaging.observations import FrameObservations, unpack_observations
from server.messaging.packed_arrays import pack_detections, pack_histograms
from server.service.identity.service_area import ServiceArea, ingest_area
from server.service.identity.sharding import AreaSighting, ShardingByArea, TracksOfPeople
from server.service.service import BestViewService
from server.system.errors import UserError

SIZE = (640, 360)
WEST, EAST = (0.0, 0.0, 100.0, 400.0), (100.0, 0.0, 640.0, 400.0)
GROUND = np.eye(3)
"""Pixels of the picture are the floor's unit."""


def sharding(index: int, *, floor: bool = True) -> ShardingSettings:
    """Return two areas, in the west and in the east; c0 looks at the west, and both cameras see both."""
    return ShardingSettings.model_validate(
        {
            "of": 2,
            "index": index,
            "servers": ["http://west:1/", "http://east:1/"],
            "areas": [
                {"cameras": ["c0"], "also": ["c1"], "floor": WEST if floor else None, "margin": 20.0},
                {"cameras": ["c1"], "also": ["c0"], "floor": EAST if floor else None, "margin": 20.0},
            ],
        }
    )


def at(x: float) -> tuple[float, float, float, float]:
    """Return the box of a person whose feet are at (x, 200)."""
    return (x - 10.0, 140.0, x + 10.0, 200.0)


def seen(camera: str, epoch: int, *places: float) -> CameraTracks:
    """Return a camera's message about people at these places, as tracks from 1 on."""
    message = camera_tracks(camera, epoch, {track: at(x) for track, x in enumerate(places, 1)})
    return msgspec.structs.replace(message, size=SIZE)


def test_people_beyond_the_margin_are_not_taken_in() -> None:
    area = ServiceArea(sharding(0), dict.fromkeys(CAMERAS, GROUND), SIZE)
    found = FrameObservations(
        pulse=0,
        boxes=pack_detections(np.array([at(50), at(119), at(300)]), np.array([0.5, 0.6, 0.7])),
        histograms=pack_histograms(np.eye(3)),
    )
    message = msgspec.structs.replace(seen("c0", 0, 50.0, 119.0, 121.0, 300.0), observations=[found])
    near = area.without_far_people(epoch_of(0, message)).tracks["c0"]
    assert [track.id for track in near.tracks] == [1, 2]
    kept = unpack_observations(near.observations[0])
    assert kept.scores == pytest.approx([0.5, 0.6], abs=1e-6)
    assert kept.histograms.argmax(axis=1).tolist() == [0, 1]


def test_hidden_people_and_those_of_uncalibrated_cameras_are_taken_in() -> None:
    area = ServiceArea(sharding(0), {"c0": GROUND, "c1": None}, SIZE)
    hidden = camera_tracks("c0", 0, {1: None})
    assert len(area.without_far_people(epoch_of(0, hidden)).tracks["c0"].tracks) == 1
    assert len(area.without_far_people(epoch_of(0, seen("c1", 0, 600.0))).tracks["c1"].tracks) == 1


class TwoAreas:
    """The people of both areas, which hear from each other an epoch later."""

    def __init__(self, *, floor: bool = True) -> None:
        self.areas = [
            ShardingByArea(
                sharding(index, floor=floor),
                ServiceArea(sharding(index, floor=floor), dict.fromkeys(CAMERAS, GROUND), SIZE),
                25.0,
            )
            for index in (0, 1)
        ]

    def step(self, frame: int, seen: Sequence[CameraTracks]) -> list[int]:
        """Show both services person 7 in some cameras; return in which areas the person is."""
        for index, area in enumerate(self.areas):
            other = {
                number: AreaSighting(1 - index, last, is_visible=True)
                for number, last in self.areas[1 - index].present.items()
            }
            area.update([TracksOfPeople(message, [7]) for message in seen], frame)
            area.set_sightings(other)
        return [index for index, area in enumerate(self.areas) if area.own([7], {})]


def test_who_walks_into_another_area_is_in_both_and_then_there() -> None:
    both = TwoAreas()

    def at_place(frame: int, x: float) -> list[int]:
        return both.step(frame, [seen(camera, 0, x) for camera in CAMERAS])

    assert at_place(0, 50.0) == [0]
    assert at_place(5, 150.0) == [0, 1]
    assert at_place(50, 150.0) == [0, 1]
    assert at_place(60, 150.0) == [1]
    assert both.areas[0].others([7], {}) == [7]
    assert [area.shard_of(7) for area in both.areas] == [1, 1]


@pytest.mark.parametrize("floor", [True, False])
def test_whom_both_lose_sight_of_stays_in_one_area(floor: bool) -> None:
    both = TwoAreas(floor=floor)
    border = [seen("c0", 0, 99.0), seen("c1", 0, 101.0)]
    assert all(both.step(frame, border) for frame in range(0, 50, 5))
    found = [both.step(frame, []) for frame in range(50, 500, 5)]
    assert all(found)
    assert len(found[-1]) == 1


def test_without_floors_who_is_seen_by_a_camera_of_each_area_ends_in_one() -> None:
    both = TwoAreas(floor=False)
    border = [seen(camera, 0, 100.0) for camera in CAMERAS]
    found = [both.step(frame, border) for frame in range(0, 200, 5)]
    assert all(found)
    assert len(found[-1]) == 1


def test_nobody_leaves_an_area_before_another_has_them() -> None:
    area = ShardingByArea(sharding(0), ServiceArea(sharding(0), dict.fromkeys(CAMERAS, GROUND), SIZE), 25.0)
    area.update([TracksOfPeople(seen("c0", 0, 50.0), [3])], 0)
    area.update([TracksOfPeople(seen("c0", 0, 110.0), [3])], 500)
    assert area.own([3], {}) == [3]
    area.renumber({3: 8})
    assert area.own([3, 8], {}) == [8]
    area.keep_only([])
    assert area.own([8], {}) == []


def config_of_areas(index: int, **more: Any) -> Config:
    """Return the configuration of one of two services, each of which takes in one camera."""
    areas = [{"cameras": ["c0"]}, {"cameras": ["c1"]}]
    return small_config(view={"sharding": {"of": 2, "index": index, "areas": areas, **more}})


def test_a_service_takes_in_the_cameras_zones_and_rules_of_its_area() -> None:
    square = [[0, 0], [9, 0], [9, 9]]
    content = {
        "view": {"sharding": {"of": 2, "areas": [{"cameras": ["c0"]}, {"cameras": ["c1"]}]}},
        "zones": [
            {"id": "here", "camera": "c0", "area": square},
            {"id": "there", "camera": "c1", "area": square},
        ],
        "rules": [{"id": zone, "kind": "entered", "zone": zone} for zone in ("here", "there")],
    }
    own = small_config(**content).of_service()
    assert own.camera_ids == ("c0",)
    assert own.site_camera_ids == CAMERAS
    assert [zone.id for zone in own.zones] == [rule.id for rule in own.rules] == ["here"]
    assert own.of_service() is own
    assert (own.person_numbers.index, own.person_numbers.step) == (0, 2)
    assert ingest_area(own, {}) is None
    assert small_config().of_service().camera_ids == CAMERAS


@pytest.mark.parametrize(
    ("of", "areas", "reason"),
    [
        (2, [{"cameras": ["c0", "c1"]}], "areas: has 1, but there are 2 shards"),
        (2, [{"cameras": ["c0"]}, {"cameras": ["c0"]}], "areas: camera c0 is in two"),
        (1, [{"cameras": ["c0"]}], "camera c1 is in none"),
        (2, [{"cameras": ["c0"]}, {"cameras": ["c1", "c9"]}], "there is no camera 'c9'; there are c0, c1"),
        (
            2,
            [{"cameras": ["c0"]}, {"cameras": ["c1"], "also": ["c1"]}],
            "'c1' is not a camera of another area",
        ),
        (1, [{"cameras": ["c0", "c1"], "floor": [0, 0, 0, 5]}], "is no rectangle"),
    ],
)
def test_areas_that_do_not_fit_are_refused(of: int, areas: list[dict[str, Any]], reason: str) -> None:
    with pytest.raises(UserError, match=reason):
        small_config(view={"sharding": {"of": of, "areas": areas}})


def test_a_rule_about_cameras_that_no_area_has_together_is_refused() -> None:
    areas = [{"cameras": ["c0"]}, {"cameras": ["c1"]}]
    rule = {"id": "door", "kind": "entered", "cameras": ["c0", "c1"]}
    with pytest.raises(UserError, match="rules: door: no area has all of its cameras"):
        small_config(view={"sharding": {"of": 2, "areas": areas}}, rules=[rule])


@pytest.fixture
async def west_service() -> AsyncIterator[str]:
    """Serve the first of two areas."""
    servers = ["http://west:1/", "http://east:1/"]
    service = FedService(config_of_areas(0, servers=servers).of_service())
    service.connect_cameras("c0")
    for epoch in range(4):
        service.feed(epoch, {"c0": {1: SMALL}})
    area = service.decider.people.sharding
    assert isinstance(area, ShardingByArea)
    area.set_sightings({2: AreaSighting(1, 0, is_visible=True), 4: AreaSighting(1, 0, is_visible=False)})
    async with serving(make_app(BestViewService(service)), HttpSettings(port=0)) as port:
        yield f"http://127.0.0.1:{port}"
    service.close()


async def test_people_of_other_areas_are_listed_with_their_service(west_service: str) -> None:
    async with aiohttp.ClientSession() as session, session.get(west_service + "/api/objects") as answer:
        listed = await answer.json()
    assert [person["object"] for person in listed["objects"]] == [1]
    assert [(each["object"], each["server"], each["visible"]) for each in listed["elsewhere"]] == [
        (2, "http://east:1/", True),
        (4, "http://east:1/", False),
    ]


def test_who_leaves_the_area_is_listed_here_or_there_and_never_in_both() -> None:
    service = FedService(config_of_areas(0).of_service())
    service.connect_cameras("c0")
    for epoch in range(4):
        service.feed(epoch, {"c0": {1: SMALL}})
    area = service.decider.people.sharding
    assert isinstance(area, ShardingByArea)
    there = {1: AreaSighting(1, 1_000_000, is_visible=True)}
    area.set_sightings(there)

    def listed() -> tuple[list[int], list[int]]:
        found = objects_info(BestViewService(service))
        return [person.object for person in found.objects], [person.object for person in found.elsewhere]

    assert listed() == ([1], [])
    area.update([], 100)
    assert area.own([1], {}) == [], "released, which no decision has taken in"
    assert listed() == ([1], [])
    service.feed(4, {"c0": {}})
    area.set_sightings(there)
    assert listed() == ([], [1])
    service.close()


async def test_watch_lists_people_of_other_areas(west_service: str) -> None:
    command = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "server.cli.main", "watch", west_service, stdout=asyncio.subprocess.PIPE
    )
    output, _ = await asyncio.wait_for(command.communicate(), PATIENCE)
    rows = [line.split() for line in output.decode().splitlines()]
    assert rows[2:] == [["2", "yes", "another", "area"], ["4", "no", "another", "area"]]


async def test_live_requests_for_another_area_are_redirected(west_service: str) -> None:
    async with aiohttp.ClientSession() as session:

        async def get(path: str) -> tuple[int, str | None]:
            async with session.get(west_service + path, allow_redirects=False) as answer:
                return answer.status, answer.headers.get("Location")

        for path in ("objects/2/best.mp4?a=b", "cameras/c1/live.jpg"):
            assert await get(f"/{path}") == (307, f"http://east:1/{path}")
        assert (await get("/objects/2/hls/7.m4s"))[0] == 404  # the past of another area is not here
        assert (await get("/cameras/c9/live.jpg"))[0] == 404
        assert (await get("/api/objects/1/choice"))[0] == 200
