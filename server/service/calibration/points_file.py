"""Reader of marked points from JSON or CSV (docs/reference/files.md)."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bestview.calibration import MarkedPoints
from server.config.duplicate_keys import DuplicateKeyError, parse_json
from server.config.values import check_printable_name
from server.system.errors import UserError, reason_of

COLUMNS = ("camera", "image_x", "image_y", "floor_x", "floor_y")
ENDINGS = (".json", ".csv")
_MAX_COORDINATE = 1e9
"""Largest coordinate, in pixels or units of the floor; squares of larger ones lose all precision."""
_SHOWN = 40
"""Characters of an invalid value that an error repeats."""


@dataclass(frozen=True, slots=True)
class PointFile:
    """The content of a file of marked points."""

    unit: str | None
    cameras: tuple[MarkedPoints, ...]


@dataclass(frozen=True, slots=True)
class _Pair:
    """One marked point: x and y in the picture, x and y on the floor."""

    camera: str
    numbers: tuple[float, float, float, float]
    name: str | None = None


def read_points(path: Path) -> PointFile:
    """Read a file of marked points.

    Raises:
        UserError: it cannot be read or is invalid; the error names the line or pair.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # spreadsheets begin a CSV with a byte order mark
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {reason_of(error)}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: is not a text file") from error
    if path.suffix.lower() == ".csv":
        return _point_file(None, _from_csv(text, str(path)), str(path))
    return parse_points(_json(text, str(path)), str(path))


def parse_points(content: Mapping[str, Any], where: str) -> PointFile:
    """Read the content of a JSON file of marked points.

    Raises:
        UserError: it is invalid; the error begins with ``where``, and names the pair.
    """
    if not isinstance(content.get("cameras"), dict):
        raise UserError(
            f'{where}: has no {{"cameras": {{camera: [{{"image": [x, y], "floor": [x, y]}}, …]}}}}'
        )
    return _point_file(_unit(content, where), _from_json(content, where), where)


def points_content(points: PointFile) -> dict[str, Any]:
    """Return marked points as the content of a JSON file, for `parse_points`."""
    return {
        camera.camera: [
            {"image": image, "floor": floor} | ({"name": camera.names[at]} if camera.names else {})
            for at, (image, floor) in enumerate(
                zip(camera.image.tolist(), camera.floor.tolist(), strict=True)
            )
        ]
        for camera in points.cameras
    }


def _point_file(unit: str | None, pairs: Iterable[_Pair], where: str) -> PointFile:
    by_camera: dict[str, list[_Pair]] = {}
    for pair in pairs:
        by_camera.setdefault(pair.camera, []).append(pair)
    if not by_camera:
        raise UserError(f"{where}: has no pairs of points")
    return PointFile(unit, tuple(_camera(name, pairs) for name, pairs in by_camera.items()))


def _camera(name: str, pairs: Sequence[_Pair]) -> MarkedPoints:
    numbers = np.array([pair.numbers for pair in pairs], dtype=np.float64)
    labels = tuple(pair.name or f"pair {number}" for number, pair in enumerate(pairs, start=1))
    names = labels if any(pair.name for pair in pairs) else ()
    return MarkedPoints(name, numbers[:, :2], numbers[:, 2:], names)


def _from_csv(text: str, name: str) -> Iterator[_Pair]:
    try:
        yield from _from_rows(csv.DictReader(text.splitlines()), name)
    except csv.Error as error:
        raise UserError(f"{name}: is not CSV: {error}") from error


def _from_rows(rows: csv.DictReader[str], name: str) -> Iterator[_Pair]:
    missing = [column for column in COLUMNS if column not in (rows.fieldnames or ())]
    if missing:
        raise UserError(
            f"{name}:1: has no column {missing[0]!r}; the first line names the columns: {','.join(COLUMNS)}"
        )
    twice = next((column for column in COLUMNS if (rows.fieldnames or []).count(column) > 1), None)
    if twice is not None:
        raise UserError(f"{name}:1: has two columns {twice!r}, and only the last would be read: keep one")
    for row in rows:
        where = f"{name}:{rows.line_num}"
        camera = (row["camera"] or "").strip()
        if not camera:
            raise UserError(f"{where}: names no camera")
        check_printable_name(camera, where)
        yield _Pair(camera, _four([row[column] for column in COLUMNS[1:]], where))


def _json(text: str, name: str) -> dict[str, Any]:
    try:
        content = parse_json(text)
    except json.JSONDecodeError as error:
        raise UserError(f"{name}:{error.lineno}: is not JSON: {error.msg}") from error
    except DuplicateKeyError as error:
        raise UserError(f"{name}: {error}") from error
    except (ValueError, RecursionError) as error:  # a number with thousands of digits, or deep nesting
        raise UserError(f"{name}: is not readable JSON: {error}") from error
    return content if isinstance(content, dict) else {}


def _unit(content: Mapping[str, Any], name: str) -> str | None:
    unit = content.get("unit")
    if unit is not None and not (isinstance(unit, str) and unit.isprintable() and len(unit) <= _SHOWN):
        raise UserError(f'{name}: unit: is a word, such as "m"')
    return unit


def _from_json(content: Mapping[str, Any], name: str) -> Iterator[_Pair]:
    for camera, pairs in content["cameras"].items():
        check_printable_name(camera, name)
        if not isinstance(pairs, list):
            raise UserError(f"{name}: camera {camera}: is a list of pairs")
        for number, pair in enumerate(pairs, start=1):
            where = f"{name}: camera {camera}: pair {number}"
            try:
                (x, y), (floor_x, floor_y) = pair["image"], pair["floor"]
            except (KeyError, TypeError, ValueError):
                raise UserError(f'{where}: is not {{"image": [x, y], "floor": [x, y]}}') from None
            yield _Pair(camera, _four([x, y, floor_x, floor_y], where), _name(pair.get("name"), where))


def _name(name: Any, where: str) -> str | None:
    if name is not None and not (isinstance(name, str) and name.isprintable() and len(name) <= _SHOWN):
        raise UserError(f"{where}: name: is a text of at most {_SHOWN} letters")
    return name or None


def _four(values: Sequence[Any], where: str) -> tuple[float, float, float, float]:
    try:
        x, y, floor_x, floor_y = numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        raise UserError(f"{where}: {_shown(values)}: are not four numbers") from None
    if max(map(abs, numbers)) > _MAX_COORDINATE or not all(map(math.isfinite, numbers)):
        raise UserError(
            f"{where}: {_shown(values)}: are not four finite numbers, none beyond {_MAX_COORDINATE:g}"
        )
    return x, y, floor_x, floor_y


def _shown(values: Sequence[Any]) -> str:
    return ", ".join(" ".join(str(value).split())[:_SHOWN] for value in values)
