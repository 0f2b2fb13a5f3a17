"""A service that starts knows earlier runs' deletions, and completes interrupted ones while it serves."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import msgspec
import pytest

from fakes.service.decisions import collect_decisions
from fakes.service.running_service import RunningService
from fakes.service.scripted_cameras import CAMERAS, GOP, STRIDE
from fakes.timeouts import PATIENCE
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys
from server.messaging.service_record import DeletedPerson, ServiceRecord
from server.service.deletion.journal import JOURNAL_FILE, Deletion
from server.service.deletion.recorded_traces import RecordedTraces
from server.service.deletion.recording_deletion import RecordingDeletion

SINCE = 1000.0
DONE = Deletion(numbers=[3, 5], numbers_since=SINCE, deletes_media=False, is_done=True)
INTERRUPTED = [
    Deletion(numbers=[7], numbers_since=SINCE, deletes_media=True),
    Deletion(numbers=[8], numbers_since=SINCE, deletes_media=False),
]
OF_SESSION = Deletion(numbers=[1], numbers_since=None, deletes_media=False, is_done=True)


class OtherService:
    """Stands in for the connection to a second service, which runs and has nothing to take over yet."""

    other_services = frozenset({1})

    def __init__(self) -> None:
        self.receive: Callable[[Message], None]
        self.received: list[ServiceRecord] = []

    def exchange_records(self, receive: Callable[[Message], None], *_: object) -> None:
        self.receive = receive

    def query_states(self, _: float) -> list[bytes]:
        return []

    def publish_record(self, payload: bytes) -> None:
        self.received.append(msgspec.msgpack.decode(payload, type=ServiceRecord))

    def send(self, *deletions: DeletedPerson) -> None:
        """Send a record with deletions to the service."""
        record = ServiceRecord(service=1, pulse=0, unbroken_since=9, cameras={}, deletions=list(deletions))
        key = ZenohKeys("hall").bestview("record", 1)
        self.receive(Message(key, msgspec.msgpack.encode(record), b""))


def service_after(folder: Path, *deletions: Deletion) -> RunningService:
    """Return a service that records in a folder with these deletions of earlier runs."""
    folder.mkdir()
    (folder / JOURNAL_FILE).write_bytes(msgspec.json.encode(deletions))
    sharding = {"index": 0, "servers": [f"http://127.0.0.1:{port}/" for port in (1, 2)]}
    return RunningService(record={"folder": str(folder)}, view={"sharding": sharding})


@contextlib.asynccontextmanager
async def running(service: RunningService, other: OtherService) -> AsyncIterator[None]:
    """Run a service; it follows the pulses."""
    service.replication._bus = other  # type: ignore[assignment]
    run = asyncio.create_task(service.run())
    followed = asyncio.create_task(service.pulses.followed.wait())
    try:
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait({run, followed}, return_when=asyncio.FIRST_COMPLETED)
            assert not run.done(), run
            yield
    finally:
        run.cancel()
        followed.cancel()
        await asyncio.wait({run, followed})
        service.close()


async def decide(service: RunningService, epochs: range) -> None:
    for epoch in epochs:
        service.pulses.sent.put_nowait(end_of_epoch(epoch, STRIDE))
        await service.receive(epoch, *CAMERAS)


async def test_deletions_of_earlier_runs_are_told_and_not_repeated(tmp_path: Path) -> None:
    service, other = service_after(tmp_path / "kept", OF_SESSION, DONE, INTERRUPTED[0]), OtherService()
    followed: list[DeletedPerson] = []
    service.replication.on_deletion.append(followed.append)
    known = [
        DeletedPerson(numbers=[3, 5], numbers_since=SINCE, deletes_media=False),
        DeletedPerson(numbers=[7], numbers_since=SINCE, deletes_media=True),
    ]
    new = DeletedPerson(numbers=[3, 5], numbers_since=SINCE, deletes_media=True)
    async with running(service, other):
        other.send(*known)
        assert followed == []
        await decide(service, range(3))
        assert other.received[0].deletions == known
        other.send(*known, new)
        assert followed == [new]


async def test_a_service_serves_while_interrupted_deletions_are_completed_one_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    execute, may_end, ended = RecordingDeletion.execute, asyncio.Event(), asyncio.Event()
    begun: list[Deletion] = []

    async def execute_late(within: RecordingDeletion, deletion: Deletion) -> RecordedTraces | None:
        begun.append(deletion)
        await may_end.wait()
        try:
            return await execute(within, deletion)
        finally:
            if len(begun) == 2:
                ended.set()

    monkeypatch.setattr(RecordingDeletion, "execute", execute_late)
    service = service_after(tmp_path / "kept", *INTERRUPTED)
    decided = collect_decisions(service)
    async with running(service, OtherService()):
        await decide(service, range(4))
        assert [decision.first for decision in decided] == [0, GOP, 2 * GOP]
        assert begun == INTERRUPTED[:1]
        may_end.set()
        await ended.wait()
        assert begun == INTERRUPTED
    journal = msgspec.json.decode((tmp_path / "kept" / JOURNAL_FILE).read_bytes(), type=list[Deletion])
    assert [(each.numbers, each.is_done) for each in journal] == [([7], True), ([8], True)]


async def test_an_interrupted_deletion_that_fails_is_one_line_and_the_next_one_is_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    ended = asyncio.Event()

    async def fail(_: RecordingDeletion, deletion: Deletion) -> None:
        if deletion == INTERRUPTED[0]:
            raise KeyError("c9")
        ended.set()

    monkeypatch.setattr(RecordingDeletion, "execute", fail)
    async with running(service_after(tmp_path / "kept", *INTERRUPTED), OtherService()):
        await ended.wait()
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == [
        "deletion of a person: KeyError('c9'); tried again at the next start"
    ]
    assert "Traceback" not in caplog.text
