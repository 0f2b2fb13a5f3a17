"""Sites tell each other who is there: who walks from one into another keeps their number."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import msgspec
import pytest

from fakes.service.linked_sites import LinkedSites, linked_sites
from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL, STRIDE, FedService, camera_tracks, tracks
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys
from server.messaging.site_people import (
    MESSAGE_BYTES_MAX,
    SightingRow,
    SitePeople,
    pack_sightings,
    unpack_sightings,
)
from server.service.identity.state_recovery import state_for_cameras
from server.service.other_sites.linked_site import HEARD_S, SILENT_S
from server.service.other_sites.other_sites import UNHEARD_S

A, B = 1, 4
KEYS = ZenohKeys("yard")
"""Tracks, whose looks are as their numbers."""


@pytest.fixture
def sites() -> Iterator[LinkedSites]:
    with linked_sites() as sites:
        yield sites


async def test_who_walks_from_one_site_into_another_keeps_their_number(sites: LinkedSites) -> None:
    sites.walk(6, hall={A: SMALL, B: LARGE})
    first = {track: sites.number("hall", track) for track in (A, B)}
    assert first == {A: 1, B: 4}
    assert sites.elsewhere("yard") == {1: "hall", 4: "hall"}
    sites.walk(4, hall={B: LARGE})
    sites.walk(4, hall={B: LARGE}, yard={A: SMALL})
    assert sites.number("yard", A) == 1
    assert sites.elsewhere("hall") == {1: "yard"}
    assert sites.elsewhere("yard") == {4: "hall"}


async def test_a_second_between_two_sites_is_enough(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(1)
    sites.walk(3, yard={A: SMALL})
    assert sites.number("yard", A) == 1


async def test_a_site_that_has_just_started_knows_who_left_another_before() -> None:
    with linked_sites("hall") as sites:
        sites.walk(6, hall={A: SMALL})
        sites.walk(4)
        sites.start("yard", first=0)
        sites.walk(2)
        assert sites.elsewhere("yard") == {1: "hall"}
        sites.walk(3, yard={A: SMALL})
        assert sites.number("yard", A) == 1


async def test_who_returns_has_their_number_at_each_site(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(3)
    sites.walk(5, yard={A: SMALL})
    sites.walk(3)
    sites.walk(5, hall={A + 8: SMALL})
    assert sites.number("hall", A + 8) == 1
    assert sites.elsewhere("hall") == {}
    assert sites.elsewhere("yard") == {1: "hall"}


async def test_a_stranger_gets_a_number_of_the_site(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(3)
    sites.walk(4, yard={B: SMALL})
    assert sites.number("yard", B) == 2


async def test_nobody_is_somebody_whom_the_other_site_sees(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(5, hall={A: SMALL}, yard={A: SMALL})
    assert (sites.number("hall", A), sites.number("yard", A)) == (1, 2)


async def test_a_site_can_keep_looks_to_itself() -> None:
    with linked_sites(sites={"share_looks": False}) as sites:
        sites.walk(5, hall={A: SMALL})
        sites.walk(3)
        assert sites.elsewhere("yard") == {1: "hall"}
        sites.walk(4, yard={A: SMALL})
        assert sites.number("yard", A) == 2
        assert not any(message.histograms or message.reference_histogram for _, message in sites.told)


async def test_who_is_at_two_sites_gets_a_new_number_where_they_arrived_later(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(3)
    sites.cut.add("yard")  # so that both believe that they have returned
    sites.walk(2, yard={A: SMALL})
    sites.now += SILENT_S
    sites.walk(2, yard={A: SMALL})
    sites.walk(5, hall={A: SMALL}, yard={A: SMALL})
    assert (sites.number("hall", A), sites.number("yard", A)) == (1, 1)
    sites.cut.clear()
    sites.walk(6, hall={A: SMALL}, yard={A: SMALL})
    assert (sites.number("hall", A), sites.number("yard", A)) == (4, 1)


async def test_a_silent_site_is_not_listed_and_those_there_have_left_after_a_while(
    sites: LinkedSites,
) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.cut.add("hall")
    sites.now += HEARD_S
    sites.walk(1, hall={A: SMALL})
    assert sites.elsewhere("yard") == {}
    sites.walk(4, hall={A: SMALL}, yard={A: SMALL})
    assert sites.number("yard", A) == 2, "who was last seen there may still be"
    sites.now += SILENT_S
    sites.walk(1)
    sites.walk(4, hall={A: SMALL}, yard={A + 8: SMALL})
    assert sites.number("yard", A + 8) in {1, 2}


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"index": 0}, "site yard: refused: it has the same sites.index as this one, 0: give each its own"),
        ({"of": 7}, "site yard: refused: its sites.of is 7, this site's 3: set the same in all sites"),
    ],
)
async def test_sites_with_the_same_numbers_are_refused_in_one_line(
    settings: dict[str, int], reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    sites = LinkedSites()
    hall = sites.start("hall")
    hall.other_sites._began = sites.now
    sites.start("yard", sites=settings)
    with caplog.at_level(logging.INFO):
        sites.walk(4, yard={A: SMALL})
        sites.now += UNHEARD_S
        sites.walk(1)
    assert caplog.messages.count(reason) == 1
    assert not any("site yard: nothing heard" in line for line in caplog.messages)
    assert sites.elsewhere("hall") == {}
    assert hall.decider.people.identity.people == []
    for service in sites.running.values():
        service.close()


async def test_two_other_sites_with_the_same_index_are_refused(caplog: pytest.LogCaptureFixture) -> None:
    sites = LinkedSites()
    for name, index in (("hall", 0), ("yard", 1), ("shop", 1)):
        sites.start(name, sites={"index": index})
    with caplog.at_level(logging.ERROR):
        sites.walk(3, hall={A: SMALL}, yard={A: SMALL})
    reason = "site shop: refused: it has the same sites.index as yard, 1: give each its own"
    assert reason in caplog.messages
    for service in sites.running.values():
        service.close()


async def test_a_site_whose_numbers_begin_anew_uses_none_that_somebody_still_has(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL, B: LARGE})
    sites.walk(3, hall={B: LARGE})
    sites.walk(4, hall={B: LARGE}, yard={A: SMALL})
    assert (sites.number("yard", A), sites.number("hall", B)) == (1, 4)
    sites.stop("hall")
    sites.walk(2, yard={A: SMALL})
    sites.start("hall")
    sites.walk(4, yard={A: SMALL})
    assert [person.person_id for person in sites.running["yard"].decider.people.identity.people] == [1]
    sites.walk(5, hall={B: SMALL}, yard={A: SMALL})
    assert (sites.number("yard", A), sites.number("hall", B)) == (1, 4)


async def test_a_second_service_that_has_just_started_makes_nobody_forgotten(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(2)
    yard = sites.running["yard"].other_sites
    message = SitePeople(index=0, of=3, numbered_since=9e9, cameras=[], people=b"")
    for _ in range(5):
        yard.receive("hall", Message("", msgspec.msgpack.encode(message), b""))
        sites.walk(1)
    sites.walk(4, yard={A: SMALL})
    assert sites.number("yard", A) == 1


async def test_a_number_of_another_site_is_restored_and_raises_no_own_one(sites: LinkedSites) -> None:
    sites.walk(5, hall={A: SMALL})
    sites.walk(2)
    sites.walk(4, yard={A: SMALL})
    before = sites.running["yard"].decider.people
    snapshots = state_for_cameras(before, CAMERAS, before.newest, 100, 5.0)
    assert {person.number for person in snapshots["c0"].people} == {1}
    high = msgspec.structs.replace(snapshots["c0"].people[0], number=3 * 10**8 + 1)
    snapshots["c0"] = msgspec.structs.replace(snapshots["c0"], people=[high])
    restarted = FedService(sites.running["yard"].config)
    for camera, snapshot in snapshots.items():
        restarted.state_replication.set_present(KEYS.camera(camera, "alive"), is_present=True)
        message = Message(KEYS.camera(camera, "retained"), msgspec.msgpack.encode(snapshot), b"")
        restarted.state_replication.receive_snapshot(message)
    epoch = before.newest // STRIDE + 1
    for camera in CAMERAS:
        seen = {A: SMALL} if camera == "c0" else {}
        restarted.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, seen)))
    restarted.pulses.newest = end_of_epoch(epoch, STRIDE)
    restarted.decide()
    people = restarted.decider.people
    assert people.person_of("c0", 1, A, people.newest) == 3 * 10**8 + 1
    assert people.identity.next_id == 2
    restarted.close()


async def test_people_of_other_sites_are_bounded() -> None:
    with linked_sites(sites={"people_max": 3}) as sites:
        sites.walk(3)
        rows = [SightingRow(3 * n + 1, "c0", float(n), None) for n in range(200)]
        deliver(sites, rows)
        sites.walk(2)
        yard = sites.running["yard"]
        assert sorted(yard.other_sites.last_sightings.by_number) == [1, 4, 7]
        assert [person.person_id for person in yard.decider.people.identity.people] == [1, 4, 7]


async def test_messages_stay_short_and_tell_everybody_in_turn(sites: LinkedSites) -> None:
    sites.walk(12, hall={A + 8 * n: SMALL for n in range(12)})
    assert max(sites.bytes) < MESSAGE_BYTES_MAX / 8
    told = {row.number for sender, message in sites.told[-6:] for row in unpack_sightings(message)}
    assert told == set(sites.elsewhere("yard"))


async def test_damaged_messages_are_counted_and_dropped(sites: LinkedSites) -> None:
    sites.walk(3, hall={A: SMALL})
    yard = sites.running["yard"].other_sites
    for payload in (b"", b"\x93\x01\x02", b"x" * (MESSAGE_BYTES_MAX + 1)):
        yard.receive("hall", Message(ZenohKeys("hall").bestview("people"), payload, b""))
    assert yard.bad_messages == 3
    message = SitePeople(index=0, of=3, numbered_since=1.0, cameras=["c0"], people=b"")
    double = pack_sightings([SightingRow(1, "c0", 0.0, None)] * 2, ["c0"])
    damaged = msgspec.structs.asdict(message) | {"people": double}
    with pytest.raises(msgspec.ValidationError, match="a person has two sightings"):
        msgspec.msgpack.decode(msgspec.msgpack.encode(damaged), type=SitePeople)


def deliver(sites: LinkedSites, rows: list[SightingRow]) -> None:
    since = sites.running["hall"].state_replication.numbers_since
    message = SitePeople(
        index=0, of=3, numbered_since=since or 1.0, cameras=["c0"], people=pack_sightings(rows, ["c0"])
    )
    sites.deliver("hall", msgspec.msgpack.encode(message))
