"""Services that divide a site by area know the same people as one that has all of it."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import pytest

from benchmarks.scaling.divided_hall import DividedRun, Observed, agreement, divide, observe, run_divided
from benchmarks.scaling.simulated_hall import SimulatedHall
from fakes.service.scripted_cameras import LARGE, SMALL, FedService, TrackNumbers, small_config
from server.messaging.camera_identity_snapshot import CameraIdentitySnapshot, PersonSnapshot
from server.messaging.service_record import AreaStay, ServiceRecord
from server.service.replication.areas import AreaAgreement


@pytest.fixture(scope="module")
def hall() -> SimulatedHall:
    """A hall of 16 cameras, with six people in each view."""
    return SimulatedHall(16, 6)


@pytest.fixture(scope="module")
def observed(hall: SimulatedHall) -> list[Observed]:
    return observe(hall, 50)


@pytest.fixture(scope="module")
def whole(hall: SimulatedHall, observed: list[Observed]) -> DividedRun:
    """One service for everything."""
    return run_divided(hall, observed, 1)


@pytest.mark.parametrize("services", [2, 4, pytest.param(8, marks=pytest.mark.slow)])
def test_services_know_the_same_people_as_one(
    hall: SimulatedHall, observed: list[Observed], whole: DividedRun, services: int
) -> None:
    divided = run_divided(hall, observed, services)
    assert agreement(whole.numbers[-1], divided.numbers[-1]) == 1.0
    assert len(whole.numbers[-1]) == len(divided.numbers[-1])
    assert divided.changes <= whole.changes + 1
    people = len(set(observed[-1].people.values()))
    assert divided.doubled <= 0.02 * people * len(observed)


def test_areas_divide_a_halls_cameras(hall: SimulatedHall) -> None:
    areas = divide(hall, 4)
    assert sorted(camera for area in areas for camera in area["cameras"]) == hall.ids
    assert all(not set(area["cameras"]) & set(area["also"]) for area in areas)


class TestAgreement:
    """What a service takes over from another area's record that arrives one epoch later."""

    @staticmethod
    def record(
        service: int, pulse: int, tracks: dict[int, int], in_area: dict[int, int], since: float = 0.0
    ) -> ServiceRecord:
        """Return a record of tracks of the shared camera c1, by number, and since when people are there."""
        snapshot = CameraIdentitySnapshot(
            pulse=pulse,
            boot=1,
            next_number=20,
            numbered_since=since,
            people=[PersonSnapshot(number=number, tracks=[track]) for track, number in tracks.items()],
        )
        return ServiceRecord(
            service=service,
            pulse=pulse,
            unbroken_since=0,
            cameras={"c1": snapshot},
            in_area={number: AreaStay(first_seen=since, here=pulse) for number, since in in_area.items()},
            next_numbers=[600, 31],
        )

    @pytest.fixture
    def service(self) -> Iterator[FedService]:
        """The service of the first of two areas, which c1 sees as well."""
        areas = [{"cameras": ["c0"], "also": ["c1"]}, {"cameras": ["c1"]}]
        service = FedService(small_config(view={"sharding": {"of": 2, "areas": areas}}).of_service())
        service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
        service.connect_cameras("c0", "c1")
        for epoch in range(4):
            service.feed(epoch, {"c0": {1: SMALL}, "c1": {1: SMALL, 2: LARGE}})
        yield service
        service.close()

    def test_a_number_that_somebody_else_has_here_is_not_taken(self, service: FedService) -> None:
        people = service.decider.people
        agreement = AreaAgreement(service.config.view.sharding, people, 25.0)
        for pulse in range(20, 60, 5):
            there = self.record(1, pulse, {2: 1}, {1: 0})
            agreement.receive(there)
            assert agreement.step({pulse: self.record(0, pulse, {2: 2}, {1: 3})}, [there]) == 0
        assert {1, 2} <= people.registry.first_seen.keys()

    def test_the_names_of_people_in_another_area_are_taken_over(self, service: FedService) -> None:
        people = service.decider.people
        agreement = AreaAgreement(service.config.view.sharding, people, 25.0)
        there = self.record(1, 20, {1: 1, 2: 2, 3: 77}, {1: 0, 77: 0})
        named = [
            msgspec.structs.replace(person, name=f"Ann {person.number}")
            for person in there.cameras["c1"].people
        ]
        snapshot = msgspec.structs.replace(there.cameras["c1"], people=named)
        agreement.receive(msgspec.structs.replace(there, cameras={"c1": snapshot}))
        assert people.registry.names == {1: "Ann 1"}, "2 is not there, 77 is not known here"

    def test_whom_another_area_has_lost_is_not_visible_there(self, service: FedService) -> None:
        people = service.decider.people
        agreement = AreaAgreement(service.config.view.sharding, people, 25.0)
        for pulse, is_visible in [(20, True), (45, True), (46, False), (9000, False)]:
            there = self.record(1, pulse, {}, {77: 0})
            stays = {77: AreaStay(first_seen=0, here=20)}
            agreement.step({}, [msgspec.structs.replace(there, in_area=stays)])
            assert people.sharding.is_visible_elsewhere(77) is is_visible
        assert people.of_other_shards == [77], "they belong to it nevertheless"

    @pytest.mark.parametrize("area", [0, 1, 2])
    def test_somebody_in_three_areas_is_reported_by_the_first(self, area: int) -> None:
        cameras = [{"id": name, "source": "scene:room"} for name in ("c0", "c1", "c2")]
        areas = [{"cameras": ["c0"]}, {"cameras": ["c1"]}, {"cameras": ["c2"]}]
        sharding = {"of": 3, "index": area, "areas": areas}
        service = FedService(small_config(cameras=cameras, view={"sharding": sharding}).of_service())
        people = service.decider.people
        people._registry = TrackNumbers()  # type: ignore[assignment]
        service.connect_cameras(f"c{area}")
        for epoch in range(4):
            service.feed(epoch, {f"c{area}": {1: SMALL}})
        agreement = AreaAgreement(service.config.view.sharding, people, 25.0)
        others = [self.record(other, 20, {1: 1}, {1: 0}) for other in range(3) if other != area]
        for live in (others, others[::-1]):
            agreement.step({}, live)
            assert people.sharding.is_reported(1) is (area == 0)
        service.close()

    def test_numbers_that_another_service_remembers_are_not_assigned_again(
        self, service: FedService, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        people = service.decider.people
        reserved: list[int] = []
        monkeypatch.setattr(people.identity, "reserve_below", reserved.append)
        agreement = AreaAgreement(service.config.view.sharding, people, 25.0)
        agreement.receive(self.record(1, 20, {}, {}))
        assert agreement.next_numbers[1] == 31
        assert reserved == [600]

    @pytest.mark.parametrize(("later_s", "followed"), [(-5.0, True), (5.0, False)])
    def test_numbers_count_from_when_those_of_the_first_area_began(
        self, service: FedService, later_s: float, followed: bool
    ) -> None:
        own = service.state_replication.numbers_since
        service.replication._follow_numbering(self.record(1, 20, {}, {}, own + later_s))
        assert (service.state_replication.numbers_since < own) is followed
