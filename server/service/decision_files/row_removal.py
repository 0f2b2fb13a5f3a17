"""Removes people from files of decisions: whole rows, and, in events about several people, their numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from pathlib import Path

import msgspec

from server.messaging.camera_identity_snapshot import PersonNumber
from server.system.private_files import open_private, write_private

INTENT_FILE = "deletions.json"
"""In a folder of decisions: the numbers of people whose rows are being removed."""

NUMBERS_FILE = "numbering.json"
"""In a folder of decisions: when its person numbers began."""
_RESTART = re.compile(r"restart-[0-9]{1,9}")
_EVENT_FIELDS = 7
_CHUNK = 1 << 20
"""Bytes that are filtered at once."""

RowFilter = Callable[[bytes, Collection[int]], bytes]
"""Returns a row without some people; empty: nothing of it is left."""


def row_filter(name: str) -> RowFilter:
    """Return the filter for the rows of a file, by its name."""
    if name.endswith(".txt") or name.startswith("choices"):
        return _by_second_field
    return {"corrections.csv": _correction, "events.csv": _event}.get(name, lambda row, _: row)


def rows_without(name: str, data: bytes, numbers: Collection[int]) -> bytes:
    """Return whole rows of a file without some people; a header stays."""
    keep = row_filter(name)
    return b"".join(keep(row, numbers) for row in data.splitlines(keepends=True))


def copy_without(path: Path, draft: Path, size: int, numbers: Collection[int]) -> None:
    """Copy the first `size` bytes of a file, whole rows, without some people; blocks on the disk.

    Raises:
        OSError: reading or writing fails.
    """
    with path.open("rb") as file, open(draft, "wb", opener=open_private) as copy:
        while size > 0 and (rows := file.readlines(min(size, _CHUNK))):
            size -= sum(map(len, rows))
            copy.write(rows_without(path.name, b"".join(rows), numbers))


def set_numbers_since(folder: Path, since: float) -> None:
    """Write when the person numbers in a folder began, unix seconds.

    Raises:
        OSError: writing fails.
    """
    draft = folder / f".{NUMBERS_FILE}"
    write_private(draft, msgspec.json.encode({"person_numbers_since": since}))
    draft.replace(folder / NUMBERS_FILE)


def remove_from_earlier_runs(folder: Path, numbers: Collection[int]) -> None:
    """Remove people from folders of earlier runs beside one, where numbers mean the same people.

    Raises:
        OSError: it cannot be done.
    """
    since = _numbers_since(folder)
    for earlier in _earlier_runs(folder):
        if since is not None and _numbers_since(earlier) == since:
            write_intent(earlier, numbers)
            complete_interrupted(earlier)


def complete_earlier_runs(folder: Path) -> bool:
    """Complete interrupted removals in folders of earlier runs beside one; return whether there were any.

    Raises:
        OSError, ValueError: as `complete_interrupted`.
    """
    completed = [complete_interrupted(earlier) for earlier in _earlier_runs(folder)]
    return any(completed)


def _earlier_runs(folder: Path) -> list[Path]:
    """Return the folders of the runs of `myview up` that began with the same output folder."""
    root = folder.parent if _RESTART.fullmatch(folder.name) else folder
    runs = [root, *(path for path in sorted(root.glob("restart-*")) if _RESTART.fullmatch(path.name))]
    return [run for run in runs if run != folder and run.is_dir()]


def _numbers_since(folder: Path) -> float | None:
    try:
        return msgspec.json.decode((folder / NUMBERS_FILE).read_bytes(), type=dict[str, float]).get(
            "person_numbers_since"
        )
    except (OSError, msgspec.DecodeError):
        return None


def write_intent(folder: Path, numbers: Collection[int]) -> None:
    """Write whose rows are being removed; `complete_interrupted` reads it after a crash.

    Raises:
        OSError: writing fails; there is none.
    """
    draft = folder / f".{INTENT_FILE}"
    write_private(draft, msgspec.json.encode(sorted(numbers)))
    draft.replace(folder / INTENT_FILE)


def complete_interrupted(folder: Path) -> bool:
    """Remove what a crash has left of people in a folder that nobody writes to; return whether there was any.

    Raises:
        OSError, ValueError: it cannot be done, or the intent is damaged.
    """
    intent = folder / INTENT_FILE
    try:
        numbers = msgspec.json.decode(intent.read_bytes(), type=list[PersonNumber])
    except (FileNotFoundError, NotADirectoryError):
        return False
    except msgspec.DecodeError as error:
        raise ValueError(f"{intent}: {error}") from error
    for path in (*folder.glob("*.csv"), *folder.glob("tracks/*.txt")):
        draft = path.with_suffix(".new")
        copy_without(path, draft, path.stat().st_size, numbers)
        draft.replace(path)
    intent.unlink()
    return True


def _by_second_field(row: bytes, numbers: Collection[int]) -> bytes:
    fields = row.split(b",", 2)
    return b"" if len(fields) > 1 and _number(fields[1]) in numbers else row


def _correction(row: bytes, numbers: Collection[int]) -> bytes:
    people = {_number(field) for field in row.split(b",")[2:4]}
    return row if people.isdisjoint(numbers) else b""


def _event(row: bytes, numbers: Collection[int]) -> bytes:
    fields = row.split(b",")
    if len(fields) < _EVENT_FIELDS:
        return row
    people = fields[5].split()
    left = [number for number in people if _number(number) not in numbers]
    if len(left) == len(people):
        return row
    return b",".join([*fields[:5], b" ".join(left), *fields[6:]]) if left else b""


def _number(field: bytes) -> int:
    return int(field) if field.isdigit() else -1
