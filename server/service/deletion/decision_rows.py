"""Recorded decisions about people: finding them, and removing people from them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

import msgspec

from server.messaging.messages import DECODE_ERRORS, GopChoices
from server.system.private_files import write_private

_DECODER = msgspec.json.Decoder(GopChoices)


def mention_pattern(numbers: Collection[int]) -> re.Pattern[bytes]:
    """Return a pattern that is in the JSON of every decision about one of these people, and in few others."""
    return re.compile(rb'[\[:"](?:%b)[,"}]' % b"|".join(b"%d" % number for number in sorted(numbers)))


def decisions_with(path: Path, pattern: re.Pattern[bytes]) -> Iterator[GopChoices]:
    """Yield the decisions of a file that have a pattern; none of a file that is gone.

    Raises:
        OSError: it cannot be read.
    """
    for line in _lines(path, pattern):
        if pattern.search(line) is not None:
            try:
                yield _DECODER.decode(line)
            except DECODE_ERRORS:  # an incomplete line
                continue


def _lines(path: Path, pattern: re.Pattern[bytes]) -> list[bytes]:
    """Return the lines of a file with their ends; none if the pattern is in none, or the file is gone."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:  # deleted by retention
        return []
    return [] if pattern.search(data) is None else data.splitlines(keepends=True)


def remove_rows(path: Path, numbers: Collection[int]) -> None:
    """Remove people from a file of decisions that is not being written; blocks on the disk.

    Raises:
        OSError: the file cannot be replaced; it is unchanged.
    """
    pattern = mention_pattern(numbers)
    lines = [
        line if pattern.search(line) is None else _without(line, numbers) for line in _lines(path, pattern)
    ]
    if not lines:
        return
    draft = path.with_suffix(".new")
    write_private(draft, b"".join(lines))
    if path.exists():
        draft.replace(path)
    else:
        draft.unlink()


def _without(line: bytes, numbers: Collection[int]) -> bytes:
    try:
        choices = _DECODER.decode(line)
    except DECODE_ERRORS:
        return b""  # the incomplete last line of a process that was killed
    return msgspec.json.encode(without_people(choices, numbers)) + b"\n"


def is_about(choices: GopChoices, numbers: Collection[int]) -> bool:
    """Return whether a decision mentions one of these people."""
    return without_people(choices, numbers) != choices


def without_people(choices: GopChoices, numbers: Collection[int]) -> GopChoices:
    """Return a decision without some people."""
    return msgspec.structs.replace(
        choices,
        choices={number: camera for number, camera in choices.choices.items() if number not in numbers},
        boxes={
            camera: [[box for box in boxes if box[0] not in numbers] for boxes in frames]
            for camera, frames in choices.boxes.items()
        },
        cuts=[cut for cut in choices.cuts if cut.object not in numbers],
        merged=[each for each in choices.merged if each.kept not in numbers and each.lost not in numbers],
        split=[each for each in choices.split if each.kept not in numbers and each.new_object not in numbers],
    )
