"""What was said about the past: who was where, and which camera showed whom."""

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
    """What was said about one GOP."""

    choices: GopChoices
    is_numbered: bool = True
    """Whether people's numbers in it are the same people's as now."""
    line: bytes | None = None
    """As it is told; None: it is not on the disk yet."""


async def read_decisions(past: Recorder, start: int, end: int) -> AsyncIterator[LoggedDecision]:
    """Return what was said about pulses ``start … end - 1``, in order."""
    at, numbered = start, past.numbered
    for run in past.runs:
        name = run.folder.name.encode()
        for path in run.index_of(at, end):
            for line, choices in await run_in_reader_thread(_lines, path, at, end):
                if run in numbered:
                    yield LoggedDecision(choices, line=line)
                else:
                    yield LoggedDecision(choices, is_numbered=False, line=b'{"run":"%b",' % name + line[1:])
                at = choices.first + choices.frames
    for choices in past.recent.choices(at):
        if choices.first < end:
            yield LoggedDecision(choices)


async def read_decision_lines(past: Recorder, start: int, end: int) -> AsyncIterator[bytes]:
    """Give the choices about pulses ``start … end - 1`` in order, each as a line of JSON (event ``gop``).

    What an earlier run has said has that run's name in it, where its numbers are other people's.
    """
    async for it in read_decisions(past, start, end):
        yield msgspec.json.encode(it.choices) + b"\n" if it.line is None else it.line


def _lines(path: Path, start: int, end: int) -> list[tuple[bytes, GopChoices]]:
    """Read an index; a line that is not whole is being written now."""
    found = []
    try:
        data = path.read_bytes()
    except OSError:  # retention has just taken it away, or it cannot be read
        return []
    for line in data.splitlines(keepends=True):
        try:
            choices = msgspec.json.decode(line, type=GopChoices)
        except DECODE_ERRORS:
            continue
        if choices.first + choices.frames > start and choices.first < end:
            found.append((line, choices))
    return found
