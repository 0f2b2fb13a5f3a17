"""Reads the recorded decisions: people's boxes, and the camera selected for each."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from server.messaging.messages import DECODE_ERRORS, GopChoices
from server.service.recording.media_files import run_in_reader_thread
from server.service.recording.recorder import Recorder


@dataclass(frozen=True, slots=True)
class LoggedDecision:
    """The decision about one GOP."""

    choices: GopChoices
    has_same_persons: bool = True
    """Whether its person numbers mean the same persons as now."""
    line: bytes | None = None
    """Its line of JSON; None: it is not on the disk yet."""


async def read_decisions(recorder: Recorder, start: int, end: int) -> AsyncIterator[LoggedDecision]:
    """Yield the decisions about pulses ``start … end - 1``, in order."""
    at, same_persons = start, recorder.sessions_with_same_persons
    for session in recorder.compatible_sessions:
        name = session.folder.name.encode()
        for path in session.decision_files(at, end):
            for line, choices in await run_in_reader_thread(_lines, path, at, end):
                if session in same_persons:
                    yield LoggedDecision(choices, line=line)
                else:
                    yield LoggedDecision(
                        choices, has_same_persons=False, line=b'{"run":"%b",' % name + line[1:]
                    )
                at = choices.first + choices.frames
    for choices in recorder.recent.choices(at):
        if choices.first < end:
            yield LoggedDecision(choices)


async def read_decision_lines(recorder: Recorder, start: int, end: int) -> AsyncIterator[bytes]:
    """Yield the decisions about pulses ``start … end - 1`` in order, each as a line of JSON (event ``gop``).

    Lines of an earlier session whose numbers mean other persons carry that session's name as ``run``.
    """
    async for decision in read_decisions(recorder, start, end):
        yield msgspec.json.encode(decision.choices) + b"\n" if decision.line is None else decision.line


def _lines(path: Path, start: int, end: int) -> list[tuple[bytes, GopChoices]]:
    """Read a decision file; an incomplete last line is being written now."""
    lines = []
    try:
        data = path.read_bytes()
    except OSError:  # deleted by retention, or not readable
        return []
    for line in data.splitlines(keepends=True):
        try:
            choices = msgspec.json.decode(line, type=GopChoices)
        except DECODE_ERRORS:
            continue
        if choices.first + choices.frames > start and choices.first < end:
            lines.append((line, choices))
    return lines
