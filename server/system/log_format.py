"""The format of log lines: text for people, or JSON for programs.

    04:31:03 INFO    bestview: camera c1 is gone
    {"time":"2026-11-22T04:31:03.120Z","level":"INFO","process":"bestview","event":"camera c1 is gone",
     "camera":"c1"}

The camera or object of a line is found by its template: ``log.info("camera %s is gone", camera)``.
"""

from __future__ import annotations

import logging
import os
import re
from datetime import UTC, datetime
from types import TracebackType

import msgspec

from server.system.address_redaction import cut_at_addresses
from server.system.errors import UserError

_ExcInfo = tuple[type[BaseException], BaseException, TracebackType | None] | tuple[None, None, None]

VARIABLE = "MYVIEW_LOG_FORMAT"
_FORMATS = ("text", "json")
_PLACE = re.compile(r"(?:\b(camera|object) )?%[-#0 +]*[0-9]*(?:\.[0-9]+)?([a-zA-Z%])")


class RedactingFormatter(logging.Formatter):
    """Formats log lines as text, with tracebacks below them in which addresses are redacted."""

    def formatException(self, ei: _ExcInfo) -> str:  # noqa: N802 — as logging calls it
        """Return a traceback with addresses redacted."""
        return cut_at_addresses(super().formatException(ei))


class JsonLines(RedactingFormatter):
    """Formats each record as one line of JSON, including its traceback."""

    def __init__(self, process: str) -> None:
        super().__init__()
        self._process = process

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, without a newline."""
        time = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        line: dict[str, object] = {
            "time": time.replace("+00:00", "Z"),
            "level": record.levelname,
            "process": self._process,
            "logger": record.name,
            "event": record.getMessage(),
            **_subjects(record),
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        encodable = {
            key: _encodable(value) if isinstance(value, str) else value for key, value in line.items()
        }
        return msgspec.json.encode(encodable, enc_hook=lambda value: _encodable(str(value))).decode()


def _encodable(text: str) -> str:
    r"""Escape surrogates, as in a file name that is not UTF-8, as \udc80."""
    return text.encode("utf-8", "backslashreplace").decode()


def formatter(process: str) -> logging.Formatter:
    """Return the log formatter of a process, chosen by MYVIEW_LOG_FORMAT.

    Raises:
        UserError: MYVIEW_LOG_FORMAT is not a format.
    """
    if is_json():
        return JsonLines(process)
    name = process.replace("%", "%%")
    return RedactingFormatter(f"%(asctime)s %(levelname)-7s {name}: %(message)s", datefmt="%H:%M:%S")


def is_json() -> bool:
    """Return whether log lines are JSON.

    Raises:
        UserError: MYVIEW_LOG_FORMAT is not a format.
    """
    wanted = os.environ.get(VARIABLE) or "text"
    if wanted not in _FORMATS:
        raise UserError(f"environment: {VARIABLE}: is {wanted!r}, not {' or '.join(_FORMATS)}")
    return wanted == "json"


def _subjects(record: logging.LogRecord) -> dict[str, object]:
    """Return the camera and object of a record, found by their names in its template."""
    if not isinstance(record.args, tuple) or not isinstance(record.msg, str):
        return {}
    values = iter(record.args)
    subjects: dict[str, object] = {}
    for place in _PLACE.finditer(record.msg):
        component, kind = place.groups()
        if kind == "%":
            continue
        value = next(values, None)
        if component is not None and value is not None:
            subjects.setdefault(component, value)
    return subjects
