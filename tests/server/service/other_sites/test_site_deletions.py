"""A person who is deleted at one site is deleted at all, also at one that was cut off or not running then."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
import pytest

from bestview import IdSeries
from fakes.service.linked_sites import LinkedSites, linked_sites
from fakes.service.scripted_cameras import LARGE, SMALL
from fakes.timeouts import PATIENCE
from server.messaging.service_record import DeletedPerson
from server.messaging.site_people import DELETIONS_MAX, MESSAGE_BYTES_MAX, SiteDeletion
from server.service.deletion.journal import JOURNAL_FILE, Deletion
from server.service.facade.deletion import DeletePerson
from server.service.other_sites.deletions import SiteDeletions
from server.service.other_sites.numbering_ledger import LEDGER_FILE, NumberingLedger
from server.service.service import BestViewService

A, B = 1, 4


def serve(sites: LinkedSites) -> dict[str, BestViewService]:
    return {name: BestViewService(service) for name, service in sites.running.items()}


def known(sites: LinkedSites, name: str) -> set[int]:
    """Return whom a site knows."""
    people = sites.running[name].decider.people
    return {person.person_id for person in people.identity.people} | set(people.registry.first_seen)


def let_walk(sites: LinkedSites) -> None:
    """Let a person walk from the hall into the yard, where they stay."""
    sites.walk(4, hall={A: SMALL})
    sites.walk(2)
    sites.walk(4, yard={A: SMALL})
    assert sites.number("yard", A) == 1


async def test_a_site_that_was_cut_off_deletes_the_person_once_it_is_reached() -> None:
    with linked_sites() as sites:
        services = serve(sites)
        let_walk(sites)
        sites.cut.add("yard")
        await services["hall"].deletion.delete(DeletePerson(1, "keep"))
        sites.walk(3, yard={A: SMALL})
        assert sites.number("yard", A) == 1
        sites.cut.clear()
        sites.walk(3, yard={A: SMALL})
        assert sites.number("yard", A) == 2, "who is visible is somebody new"
        assert known(sites, "hall") | known(sites, "yard") == {2}


async def test_a_deletion_reaches_all_sites_wherever_the_number_is_from() -> None:
    with linked_sites("hall", "yard", "shop") as sites:
        services = serve(sites)
        let_walk(sites)
        sites.walk(2, yard={A: SMALL}, shop={B: LARGE})
        people = sites.running["yard"].decider.people
        people.merge(1, people.split_off(1, ["c0"]) or 0)  # number 2 is merged into 1
        await services["yard"].deletion.delete(DeletePerson(1, "keep"))
        sites.walk(4, yard={A: SMALL}, shop={B: LARGE})
        assert known(sites, "hall") == known(sites, "shop") == {3, 5}
        assert sites.number("yard", A) == 5
        deleted = {
            (sender, number)
            for sender, message in sites.told[-3:]
            for deletion in message.deletions
            for number in deletion.numbers
        }
        assert deleted >= {("hall", 1), ("yard", 1), ("yard", 2), ("shop", 1)}


async def test_a_site_that_was_restarted_still_tells_of_its_deletions(tmp_path: Path) -> None:
    record = {"folder": str(tmp_path / "kept")}
    with linked_sites() as sites:
        sites.stop("hall")
        sites.start("hall", record=record)
        sites.running["hall"].recorder.open()
        services = serve(sites)
        let_walk(sites)
        sites.cut.add("yard")
        await services["hall"].deletion.delete(DeletePerson(1, "keep"))
        sites.stop("hall")
        hall = sites.start("hall", record=record)
        hall.recorder.open()
        for deleted in await hall.recording_deletion.read_journal():
            hall.replication.add_deletion(deleted)
        sites.cut.clear()
        sites.walk(4, hall={B: LARGE}, yard={A: SMALL})
        assert sites.number("yard", A) == 2
        assert 1 not in known(sites, "yard")


async def test_recordings_of_earlier_runs_lose_the_person_too(tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    folder.mkdir()
    earlier = NumberingLedger(folder)
    for own_since, since in ((100.0, 7.0), (200.0, 7.0), (300.0, 8.0)):
        assert earlier.add(own_since, 0, since)
    assert not earlier.add(100.0, 0, 7.0)
    earlier.write()
    with linked_sites("hall") as sites:
        yard = sites.start("yard", record={"folder": str(folder)})
        yard.recorder.open()
        services = serve(sites)
        yard.other_sites._ledger.read()
        sites.walk(1, yard={B: LARGE})
        told = SiteDeletion(index=0, numbered_since=7.0, numbers=[1], deletes_media=True)
        sites.running["hall"].other_sites._deletions.to_publish = lambda *_: [told]  # type: ignore[method-assign]
        sites.walk(2, hall={A: SMALL}, yard={B: LARGE})
        async with asyncio.timeout(PATIENCE):
            await asyncio.gather(*services["yard"].deletion._running)
    found = msgspec.json.decode((folder / JOURNAL_FILE).read_bytes(), type=list[Deletion])
    assert [(each.numbers, each.numbers_since, each.deletes_media, each.is_done) for each in found] == [
        ([1], 100.0, True, True),
        ([1], 200.0, True, True),
    ]


async def test_all_deletions_are_told_in_turn() -> None:
    with linked_sites() as sites:
        sites.walk(1, hall={A: SMALL})
        hall = sites.running["hall"]
        since = hall.state_replication.numbers_since
        for number in range(1, 300, 3):
            deletion = DeletedPerson(numbers=[number], numbers_since=since, deletes_media=False)
            hall.replication.add_deletion(deletion)
        sites.told.clear()
        sites.walk(13)
        messages = [message.deletions for sender, message in sites.told if sender == "hall"]
        assert max(map(len, messages)) <= DELETIONS_MAX
        assert {number for told in messages for each in told for number in each.numbers} == {
            *range(1, 300, 3)
        }


async def test_deletions_of_many_numbers_are_told_in_short_messages() -> None:
    with linked_sites() as sites:
        sites.walk(1, hall={A: SMALL})
        hall = sites.running["hall"]
        since = hall.state_replication.numbers_since
        for first in range(10**8, 10**8 + 75_000, 3000):
            numbers = list(range(first, first + 3000, 3))
            deletion = DeletedPerson(numbers=numbers, numbers_since=since, deletes_media=False)
            hall.other_sites._deletions.add(deletion)
        sites.told.clear()
        sites.walk(18)
        told = [message.deletions for sender, message in sites.told if sender == "hall"]
        assert len({deletion.numbers[0] for deletions in told for deletion in deletions}) == 25
        assert max(sites.bytes) < MESSAGE_BYTES_MAX / 2


def test_a_damaged_ledger_is_one_line_and_counts_as_empty(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / LEDGER_FILE).write_text("[[1", encoding="utf-8")
    ledger = NumberingLedger(tmp_path)
    ledger.read()
    assert len(caplog.messages) == 1
    assert str(tmp_path / LEDGER_FILE) in caplog.messages[0]
    assert ledger.own_numberings(0, 1.0) == []


def test_numbers_of_a_site_that_was_never_heard_are_not_told() -> None:
    ledger = NumberingLedger(None)
    ledger.add(50.0, 1, 9.0)
    deletions = SiteDeletions(IdSeries(0, 3), ledger)
    deletions.add(DeletedPerson(numbers=[1, 2, 3], numbers_since=50.0, deletes_media=True))
    told = deletions.to_publish([7], 50.0)
    assert [(each.index, each.numbered_since, each.numbers, each.deletes_media) for each in told] == [
        (0, 50.0, [7], False),
        (0, 50.0, [1], True),
        (1, 9.0, [2], True),
    ]
    mixed = SiteDeletion(index=1, numbered_since=9.0, numbers=[2, 3], deletes_media=True)
    assert list(deletions.to_own(mixed, lambda numbers, _: numbers)) == []
