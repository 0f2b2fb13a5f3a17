"""What was said about the past: who was where, and which camera showed whom."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import msgspec

from server.view.past.disk import from_disk
from server.view.past.past import Past
from server.wire.messages import UNREADABLE, GopChoices


async def told(past: Past, start: int, end: int) -> AsyncIterator[bytes]:
    """Give the choices about pulses ``start … end - 1`` in order, each as a line of JSON (event ``gop``).

    What an earlier run has said has that run's name in it, where its numbers are other people's.
    """
    at, numbered = start, past.numbered
    for run in past.runs:
        for path in run.index_of(at, end):
            for line, choices in await from_disk(_lines, path, at, end):
                yield line if run in numbered else b'{"run":"%b",' % run.folder.name.encode() + line[1:]
                at = choices.first + choices.frames
    for choices in past.recent.choices(at):
        if choices.first < end:
            yield msgspec.json.encode(choices) + b"\n"


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
        except UNREADABLE:
            continue
        if choices.first + choices.frames > start and choices.first < end:
            found.append((line, choices))
    return found
