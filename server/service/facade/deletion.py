"""Deletion of a person's data: what would be deleted, and the deletion."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Collection, Coroutine
from dataclasses import dataclass, replace
from typing import Any, Literal

import msgspec

from server.config.tokens_file import read_tokens
from server.messaging.service_record import DeletedPerson
from server.service.deletion.journal import Deletion
from server.service.deletion.memory_removal import forget_people
from server.service.deletion.recorded_traces import RecordedTraces
from server.service.facade.deletion_plan import PersonDeletion, camera_losses, other_losses, rounded
from server.service.facade.errors import BusyError, ConflictError, InvalidCommandError, UnknownObjectError
from server.service.facade.people import PeopleService
from server.service.facade.rules import RulesService
from server.service.pipeline import BestViewPipeline
from server.service.recording.session_files import AUDIO
from server.system.address_redaction import located_reason_of
from server.system.errors import UserError

log = logging.getLogger(__name__)

_WAIT_S = 60.0
"""How long a deletion is waited for; it goes on in any case."""

Recordings = Literal["keep", "delete"]
"""What is done with the recorded video and sound of the times in which the person was visible."""


@dataclass(frozen=True, slots=True)
class DeletePerson:
    """Command: delete a person's data; ``run`` names a recorded session with other numbers than today's."""

    number: int
    recordings: Recordings
    run: str | None = None


@dataclass(frozen=True, slots=True)
class _Person:
    """Who is to be deleted: numbers, and where these mean the person."""

    numbers: frozenset[int]
    numbers_since: float | None
    sessions: tuple[str, ...] = ()
    """Names of sessions, where it is not known when their numbers began."""
    is_of_today: bool = True


class DeletionService:
    """Plans and carries out deletions, one at a time."""

    def __init__(self, pipeline: BestViewPipeline, people: PeopleService, rules: RulesService) -> None:
        self._pipeline, self._people, self._rules = pipeline, people, rules
        self._turn = pipeline.recording_deletion.turn
        self._running: set[asyncio.Task[None]] = set()
        pipeline.replication.on_deletion.append(self._follow)

    async def plan(self, number: int, run: str | None = None) -> PersonDeletion:
        """Return what would be deleted of a person.

        Raises:
            UnknownObjectError: neither memory nor recording know the number.
            InvalidCommandError: there is no such session.
            BusyError: the recording cannot be read.
        """
        person = self._find(number, run)
        return self._describe(number, run, person, await self._traces(number, person))

    async def delete(self, command: DeletePerson) -> PersonDeletion:
        """Delete a person's data; return what is deleted.

        Raises:
            ConflictError: another deletion is not complete yet.
            UnknownObjectError, InvalidCommandError: as `plan`.
            BusyError: the disk fails; the text says what that means.
        """
        if self._turn.locked():
            raise ConflictError("another deletion is not complete yet: try again later")
        await self._turn.acquire()
        try:
            planned, deletion = await self._begin(command)
        except BaseException:
            self._turn.release()
            raise
        completing = self._start(self._complete(deletion))
        await asyncio.wait({completing}, timeout=_WAIT_S)
        if not completing.done():
            return msgspec.structs.replace(planned, state="running", recordings=command.recordings)
        try:
            completing.result()
        except OSError as error:
            raise BusyError(
                f"object {command.number}: {located_reason_of(error)}; the rest is deleted at the next start"
            ) from error
        return msgspec.structs.replace(planned, state="done", recordings=command.recordings)

    async def _begin(self, command: DeletePerson) -> tuple[PersonDeletion, Deletion]:
        """Write the deletion down, then forget the person in memory; so a crash loses neither."""
        person = self._find(command.number, command.run)
        deletion: Deletion | None = None
        while True:  # people are merged while the disk is waited for
            traces = await self._traces(command.number, person)
            planned = self._describe(command.number, command.run, person, traces)
            before, deletion = (
                deletion,
                Deletion(
                    numbers=sorted(traces.numbers),
                    numbers_since=person.numbers_since,
                    sessions=list(person.sessions),
                    deletes_media=command.recordings == "delete",
                ),
            )
            try:
                await self._pipeline.recording_deletion.begin(deletion, before)
            except OSError as error:
                what = "nothing is deleted" if before is None else "deleted at the next start only"
                raise BusyError(f"object {command.number}: {what}: {located_reason_of(error)}") from error
            if not person.is_of_today or (numbers := self._with_merged(traces.numbers)) == traces.numbers:
                break
            person = replace(person, numbers=numbers)
        if person.is_of_today:
            self._forget(traces.numbers)
        if (message := deletion.message) is not None:
            self._pipeline.replication.add_deletion(message)
        return planned, deletion

    def _forget(self, numbers: Collection[int]) -> None:
        forget_people(self._pipeline, numbers)
        self._rules.forget(numbers)

    def _follow(self, deleted: DeletedPerson) -> None:
        """Carry out a deletion of another service."""
        if deleted.numbers_since == _since(self._pipeline):
            # In another area the person may have had other numbers before.
            numbers = sorted(self._with_merged(deleted.numbers))
            deleted = msgspec.structs.replace(deleted, numbers=numbers)
            self._forget(numbers)
        self._start(self._complete_followed(deleted))

    def _start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Start a deletion, whose error is logged whether or not somebody waits for it."""
        task = asyncio.get_running_loop().create_task(work, name="deletion")
        self._running.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._running.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("deletion of a person: %s; completed at the next start", located_reason_of(error))

    async def _complete_followed(self, deleted: DeletedPerson) -> None:
        deletion = Deletion(
            numbers=deleted.numbers,
            numbers_since=deleted.numbers_since,
            deletes_media=deleted.deletes_media,
        )
        await self._turn.acquire()
        try:
            await self._pipeline.recording_deletion.begin(deletion)
        except OSError as error:
            self._turn.release()
            log.error("deletion of a person by another service: %s", located_reason_of(error))  # noqa: TRY400
            return
        await self._complete(deletion)

    async def _complete(self, deletion: Deletion) -> None:
        """Delete what is on the disk, and release the turn."""
        pipeline = self._pipeline
        try:
            if deletion.numbers_since == _since(pipeline) and pipeline.decision_writer is not None:
                await pipeline.decision_writer.forget(deletion.numbers)
            await pipeline.recording_deletion.execute(deletion)
        finally:
            self._turn.release()
        log.info("a person's data were deleted on an operator's request")

    def _find(self, number: int, run: str | None) -> _Person:
        since = _since(self._pipeline)
        if run is not None:
            folder = self._pipeline.recorder.folder
            sessions = [] if folder is None else folder.sessions
            found = next((session for session in sessions if session.folder.name == run), None)
            if found is None:
                raise InvalidCommandError(f"run: there is no recorded session {run[:40]!r}")
            numbered = found.info.person_numbers_since
            if numbered is None or numbered != since:
                return _Person(frozenset({number}), numbered, () if numbered else (run,), is_of_today=False)
        return _Person(self._with_merged({number}), since)

    def _with_merged(self, numbers: Collection[int]) -> frozenset[int]:
        """Return these numbers, and all that are now merged with them."""
        registry = self._pipeline.decider.people.registry
        current = {registry.current(number) for number in numbers}
        return frozenset(numbers).union(current, *map(registry.aliases, current))

    async def _traces(self, number: int, person: _Person) -> RecordedTraces:
        deletion = self._pipeline.recording_deletion
        sessions = deletion.sessions_of(person.numbers_since, person.sessions)
        try:
            traces = await deletion.find(sessions, person.numbers)
        except OSError as error:
            raise BusyError(f"object {number}: nothing is deleted: {located_reason_of(error)}") from error
        known = self._pipeline.decider.people.registry.first_seen if person.is_of_today else {}
        if not traces.sessions and traces.numbers.isdisjoint(known):
            raise self._people.unknown(number) if person.is_of_today else UnknownObjectError(number)
        return traces

    def _describe(
        self, number: int, run: str | None, person: _Person, traces: RecordedTraces
    ) -> PersonDeletion:
        names = self._pipeline.decider.people.registry.names if person.is_of_today else {}
        name = next((names[each] for each in sorted(traces.numbers) if each in names), None)
        views = self._pipeline.decision_state.selected_views if person.is_of_today else {}
        return PersonDeletion(
            object=number,
            run=run,
            state="planned",
            recordings=None,
            objects=sorted(traces.numbers),
            name=name,
            visible=any(views[each].cameras for each in traces.numbers if each in views),
            events=self._rules.count_about(traces.numbers) if person.is_of_today else 0,
            decisions=sum(each.gops for each in traces.sessions),
            seen_s=rounded(sum(each.seconds for each in traces.sessions)),
            cameras=camera_losses(traces),
            sound_s=rounded(sum(each.lost[AUDIO] / each.session.info.fps for each in traces.sessions)),
            others=other_losses(traces, run if not person.is_of_today else None, names),
            mentions=self._mentions(traces.numbers, name) if person.is_of_today else [],
        )

    def _mentions(self, numbers: Collection[int], name: str | None) -> list[str]:
        config = self._pipeline.config
        found = [
            f"rules: {rule.id} names them"
            for rule in config.rules
            if any(each in numbers or (name is not None and each == name) for each in rule.people)
        ]
        if config.access.tokens is not None:
            with contextlib.suppress(UserError):  # an invalid file is reported elsewhere
                found += [
                    f"access.tokens: the token {token.name!r} is for object {token.object}"
                    for token in read_tokens(config.access.tokens)
                    if token.object in numbers
                ]
        return found


def _since(pipeline: BestViewPipeline) -> float | None:
    """Return when today's numbers began, unix seconds; None: nobody has one yet."""
    return pipeline.state_replication.numbers_since or None
