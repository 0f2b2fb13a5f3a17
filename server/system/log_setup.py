"""Logging setup: to standard error, as text or JSON."""

from __future__ import annotations

import logging
import os
import sys
import threading
from types import TracebackType

import typer

from server.system.errors import UserError
from server.system.log_format import JsonLines, formatter
from server.system.printable import printable

log = logging.getLogger("myview")


def log_to_stderr(name: str) -> None:
    """Set up logging under a process name; the level is MYVIEW_LOG, the format MYVIEW_LOG_FORMAT.

    Raises:
        UserError: MYVIEW_LOG is not a level, or MYVIEW_LOG_FORMAT is not a format.
    """
    level = os.environ.get("MYVIEW_LOG", "INFO").upper()
    if level not in logging.getLevelNamesMapping():
        raise UserError(f"environment: MYVIEW_LOG: is {level!r}, not DEBUG, INFO, WARNING or ERROR")
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter(name))
    logging.basicConfig(level=level, handlers=[handler])
    if _logs_json():  # then no other text may stand between the lines
        logging.captureWarnings(capture=True)
        sys.excepthook = _uncaught
        threading.excepthook = _uncaught_in_thread


def report_error(text: str) -> None:
    """Print a one-line error, or log it if the log is JSON."""
    if _logs_json():
        log.error("%s", text)
    else:
        typer.echo(f"myview: {printable(text)}", err=True)


def _logs_json() -> bool:
    """Return whether this process logs as JSON."""
    return any(isinstance(handler.formatter, JsonLines) for handler in logging.getLogger().handlers)


def _uncaught(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if not issubclass(kind, KeyboardInterrupt):
        log.critical("a bug in MyView", exc_info=(kind, error, trace))


def _uncaught_in_thread(failed: threading.ExceptHookArgs) -> None:
    if failed.exc_value is not None:
        _uncaught(failed.exc_type, failed.exc_value, failed.exc_traceback)
