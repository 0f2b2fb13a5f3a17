"""Deletes people from the recording: first written to the journal, so that it is completed after a crash."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Collection, Iterable
from pathlib import Path

import msgspec

from server.messaging.service_record import DeletedPerson
from server.service.deletion.decision_rows import remove_rows
from server.service.deletion.journal import Deletion, DeletionJournal
from server.service.deletion.recorded_traces import RecordedTraces, all_decision_files, find_traces
from server.service.recording.media_files import run_in_reader_thread
from server.service.recording.person_removal import remove_from_session
from server.service.recording.recorder import Recorder
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.recording_session import RecordingSession
from server.service.recording.writer_thread import WriterThread
from server.system.address_redaction import located_reason_of

log = logging.getLogger(__name__)


class RecordingDeletion:
    """Finds and deletes people in the recording; without a recording folder there are none.

    One deletion at a time: who begins or executes one holds `turn`.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self.turn = asyncio.Lock()
        folder, writer = recorder.folder, recorder.writer
        self._disk: tuple[RecordingFolder, WriterThread, DeletionJournal] | None = (
            None if folder is None or writer is None else (folder, writer, DeletionJournal(folder.folder))
        )

    async def read_journal(self) -> list[DeletedPerson]:
        """Return the deletions of earlier runs, once the recording folder is open; errors are logged."""
        if self._disk is None:
            return []
        _, _, journal = self._disk
        try:
            await run_in_reader_thread(journal.read)
        except OSError as error:
            log.error("record.folder: interrupted deletions cannot be completed: %s", error)  # noqa: TRY400
            return []
        messages = (deletion.message for deletion in journal.all)
        return [message for message in messages if message is not None]

    async def complete_interrupted(self) -> None:
        """Complete what a crash has interrupted, one after another, after `read_journal`.

        What fails is logged, and tried again at the next start.
        """
        async with self.turn:
            for deletion in [] if self._disk is None else self._disk[2].pending:
                try:
                    await self.execute(deletion)
                except Exception as error:  # noqa: BLE001 — nobody waits for it, and the others are completed
                    log.error(  # noqa: TRY400
                        "deletion of a person: %s; tried again at the next start", located_reason_of(error)
                    )
                else:
                    log.info("completed the deletion of a person that was interrupted")

    def forgotten(self, numbers_since: float) -> Collection[int]:
        """Return the numbers of the people deleted, of those that began at a time, unix seconds."""
        return set() if self._disk is None else self._disk[2].forgotten(numbers_since)

    def sessions_of(self, numbers_since: float | None, names: Iterable[str] = ()) -> list[RecordingSession]:
        """Return the sessions whose person numbers began then, and those of these names."""
        wanted = set(names)
        return [
            session
            for session in ([] if self._disk is None else self._disk[0].sessions)
            if session.folder.name in wanted
            or (numbers_since is not None and session.info.person_numbers_since == numbers_since)
        ]

    async def find(self, sessions: list[RecordingSession], numbers: Collection[int]) -> RecordedTraces:
        """Find a person's traces on the disk."""
        return await run_in_reader_thread(find_traces, sessions, numbers)

    async def begin(self, deletion: Deletion, before: Deletion | None = None) -> None:
        """Write a deletion to the journal, instead of an earlier state: from then on it will be completed.

        Raises:
            OSError: writing fails; nothing has changed.
        """
        if self._disk is not None:
            await run_in_reader_thread(self._disk[2].put, deletion, before)

    async def execute(self, deletion: Deletion) -> RecordedTraces | None:
        """Delete what is recorded until now, after `begin`; return what was there, if it was not known.

        Decisions that are made later must not mention the person any more.

        Raises:
            OSError: the disk fails; the deletion stays in the journal.
        """
        if self._disk is None:
            return None
        folder, writer, journal = self._disk
        sessions: list[RecordingSession] = []
        ended: list[Path] = []

        def end_segment() -> None:
            folder.end_segment()
            sessions.extend(self.sessions_of(deletion.numbers_since, deletion.sessions))
            ended.extend(path for session in sessions for path in all_decision_files(session))

        self._recorder.flush()
        await asyncio.wrap_future(writer.run(end_segment))
        traces = None
        if deletion.files is None:
            traces = await self.find(sessions, deletion.numbers)
            found = msgspec.structs.replace(
                deletion,
                numbers=sorted(traces.numbers),
                files={
                    each.session.folder.name: sorted(each.files) if deletion.deletes_media else []
                    for each in traces.sessions
                },
            )
            await run_in_reader_thread(journal.put, found, deletion)
            deletion = found
        numbers, files = frozenset(deletion.numbers), deletion.files or {}
        for path in ended:  # a later segment is being written, and does not mention the person
            await run_in_reader_thread(remove_rows, path, numbers)

        def remove_the_rest() -> None:
            folder.end_segment()  # the margin may reach into it
            for session in sessions:
                remove_from_session(session, numbers, files.get(session.folder.name, ()))

        await asyncio.wrap_future(writer.run(remove_the_rest))
        done = msgspec.structs.replace(deletion, sessions=[], files=None, is_done=True)
        await run_in_reader_thread(journal.put, done, deletion)
        return traces
