"""MOTChallenge text: `frame,id,left,top,width,height,confidence,x,y,z`, one row per box.

Frames count from 1 in the files and everywhere in this module; ids of detections are -1.
"""

from __future__ import annotations

import gzip
import math
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

# frame, id and the four numbers of the box; the others are optional.
_MIN_FIELDS = 6
_MAX_FIELDS = 10
_CONFIDENCE_FIELD = 6
# Larger frame numbers are probably timestamps.
_MAX_FRAME = 10_000_000
# Pixels; areas lose precision beyond it.
_MAX_COORDINATE = 1e9
# Floats represent all integers up to this.
_MAX_ID = 2**53
_MAX_UNPACKED_BYTES = 300_000_000


@dataclass(frozen=True, slots=True)
class MotRow:
    """One box of one frame.

    Attributes:
        frame: from 1.
        id: the object's id; -1 for detections.
        left: pixels, like `top`, `width` and `height`.
        confidence: the detector's, in the detector's unit; 1 in tracks, 0 in ground truth to be ignored.
        visible: visible share of the object, the ninth field of ground truth; -1: unknown.
    """

    frame: int
    id: int
    left: float
    top: float
    width: float
    height: float
    confidence: float = 1.0
    visible: float = -1.0

    @classmethod
    def of_box(cls, frame: int, number: int, box: Iterable[float], confidence: float = 1.0) -> MotRow:
        """Return the row of a box, `left, top, right, bottom` in pixels, of the object `number`."""
        left, top, right, bottom = box
        return cls(frame, number, left, top, right - left, bottom - top, confidence)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """The box as `left, top, right, bottom` in pixels."""
        return self.left, self.top, self.left + self.width, self.top + self.height


def read_rows(path: Path) -> list[MotRow]:
    """Read a MOTChallenge file, in the order of the file; `.gz` files are unpacked.

    Raises:
        ValueError: the file is not MOTChallenge text; the message names file and line.
        OSError: the file cannot be read.
    """
    data = path.read_bytes()
    if path.suffix == ".gz":
        try:
            with gzip.open(path) as file:
                data = file.read(_MAX_UNPACKED_BYTES + 1)
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise ValueError(f"{path}: not a complete gzip file: {error}") from None
        if len(data) > _MAX_UNPACKED_BYTES:
            raise ValueError(f"{path}: unpacks to more than {_MAX_UNPACKED_BYTES // 10**6} megabytes")
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not a MOTChallenge text file (byte {error.start} is not ASCII)") from None
    return list(parse_rows(text.splitlines(), str(path)))


def parse_rows(lines: Iterable[str], name: str) -> Iterator[MotRow]:
    """Parse rows one by one, skipping empty lines; errors call the source `name`.

    Raises:
        ValueError: a line is malformed; the message is one line, `name:line: error`.
    """
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                yield _parse_row(line)
            except ValueError as error:
                raise ValueError(f"{name}:{number}: {error}") from None


def format_row(row: MotRow) -> str:
    """Return the row as text with two decimals, without the line end; equal rows give equal bytes."""
    numbers = (row.left, row.top, row.width, row.height, row.confidence)
    return f"{row.frame},{row.id}," + ",".join(_format_number(number) for number in numbers) + ",-1,-1,-1"


def format_rows(rows: Iterable[MotRow]) -> str:
    """Return the text of a file, sorted by frame and id."""
    ordered = sorted(rows, key=lambda row: (row.frame, row.id, row.left, row.top))
    return "".join(format_row(row) + "\n" for row in ordered)


def write_rows(path: Path, rows: Iterable[MotRow]) -> None:
    """Write a MOTChallenge file atomically.

    Raises:
        OSError: the file cannot be written.
    """
    partial = path.with_name(path.name + ".part")
    try:
        partial.write_text(format_rows(rows), encoding="ascii")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _format_number(number: float) -> str:
    text = f"{number:.2f}"
    # A negative zero would make equal boxes differ in the file.
    return "0.00" if text == "-0.00" else text


def _parse_row(line: str) -> MotRow:
    fields = [field.strip() for field in line.split(",")]
    if not _MIN_FIELDS <= len(fields) <= _MAX_FIELDS:
        raise ValueError(f"expected {_MIN_FIELDS} to {_MAX_FIELDS} fields, found {len(fields)}")
    frame = _parse_integer(fields[0], "frame")
    if not 1 <= frame <= _MAX_FRAME:
        raise ValueError(f"frame {frame} is not between 1 and {_MAX_FRAME}")
    left, top, width, height = (
        _parse_number(field, name)
        for field, name in zip(fields[2:6], ("left", "top", "width", "height"), strict=True)
    )
    if max(map(abs, (left, top, width, height))) > _MAX_COORDINATE:
        raise ValueError(f"box coordinates are pixels up to {_MAX_COORDINATE:g}")
    if width <= 0.0 or height <= 0.0:
        raise ValueError(f"a box needs a positive width and height, not {width:g} x {height:g}")
    confidence = _parse_number(fields[6], "confidence") if len(fields) > _CONFIDENCE_FIELD else 1.0
    # Ground truth has nine fields, `..., class, visible`; results have ten, the last three of them -1.
    visible = _parse_number(fields[8], "visible") if len(fields) == _MAX_FIELDS - 1 else -1.0
    number = _parse_integer(fields[1], "id")
    if abs(number) > _MAX_ID:
        raise ValueError(f"id {fields[1][:40]} is not between -2^53 and 2^53")
    return MotRow(frame, number, left, top, width, height, confidence, visible)


def _parse_integer(text: str, name: str) -> int:
    number = _parse_number(text, name)
    if not number.is_integer():
        raise ValueError(f"{name} is a whole number, not {text[:40]!r}")
    return int(number)


def _parse_number(text: str, name: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f"{name} is a number, not {text[:40]!r}") from None
    if not math.isfinite(number):
        raise ValueError(f"{name} is a finite number, not {text[:40]!r}")
    return number
