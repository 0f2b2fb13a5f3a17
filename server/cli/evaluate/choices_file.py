"""Reader of ``choices.csv``: the camera chosen for each person in each frame."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA
from server.system.errors import UserError, reason_of

_COLUMNS = ["frame", "object", "camera"]
_LAST_FRAME = 10_000_000


@dataclass(frozen=True, slots=True)
class Choice:
    """One line of `choices.csv`."""

    frame: int
    object: int
    camera: str


def read_choices(path: Path) -> list[Choice]:
    """Read a file of choices.

    Raises:
        UserError: it cannot be read or is invalid; the error names the line.
    """
    try:
        with path.open(encoding="ascii", newline="") as file:
            lines = csv.reader(file)
            if next(lines, []) != _COLUMNS:
                raise UserError(f"{path}: is not a choices file: its first line is not {','.join(_COLUMNS)}")
            choices: dict[tuple[int, int], Choice] = {}
            for number, fields in enumerate(lines, start=2):
                choice = _choice(fields, f"{path}:{number}")
                if (choice.frame, choice.object) in choices:
                    raise UserError(f"{path}:{number}: object {choice.object} has two cameras in one frame")
                choices[choice.frame, choice.object] = choice
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {reason_of(error)}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: is not a choices file: {error}") from error
    return list(choices.values())


def views_of(
    choices: Sequence[Choice],
    person_of: Mapping[int, int],
    people: Sequence[int],
    cameras: Sequence[str],
    frames: int,
) -> NDArray[np.int64]:
    """Arrange choices by person: (K, N) camera indices, -1 without a choice.

    ``person_of`` maps objects to ``people``.

    Raises:
        UserError: a camera is not one of ``cameras``, or all choices are of later frames.
    """
    camera_at = {camera: index for index, camera in enumerate(cameras)}
    person_at = {person: index for index, person in enumerate(people)}
    views = np.full((len(people), frames), NO_CAMERA, dtype=np.int64)
    if choices and all(choice.frame > frames for choice in choices):
        first = min(choice.frame for choice in choices)
        raise UserError(f"--views: begins with frame {first}; the ground truth ends with frame {frames}")
    for choice in choices:
        if choice.camera not in camera_at:
            raise UserError(
                f"--views: camera {choice.camera!r} is not among those that are scored "
                f"({', '.join(cameras)}): it needs ground truth, and tracks if there are any"
            )
        person = person_of.get(choice.object)
        if person is not None and choice.frame <= frames:
            views[person_at[person], choice.frame - 1] = camera_at[choice.camera]
    return views


def _choice(fields: Sequence[str], where: str) -> Choice:
    if len(fields) != len(_COLUMNS):
        raise UserError(f"{where}: expected {len(_COLUMNS)} fields, found {len(fields)}")
    frame, number, camera = fields
    if not (frame.isdecimal() and number.isdecimal() and 1 <= int(frame) <= _LAST_FRAME and int(number)):
        raise UserError(f"{where}: frame and object are whole numbers from 1, not {frame!r} and {number!r}")
    return Choice(int(frame), int(number), camera)
