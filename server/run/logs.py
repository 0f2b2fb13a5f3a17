"""Log lines: one per event that matters, to standard error, never one per frame."""

from __future__ import annotations

import logging
import os
import sys

from server.wire.errors import UserError

_FORMAT = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"


def log_to_stderr(name: str) -> None:
    """Log under the name of this process; MYVIEW_LOG=DEBUG shows more.

    Raises:
        UserError: MYVIEW_LOG is no level.
    """
    level = os.environ.get("MYVIEW_LOG", "INFO").upper()
    if level not in logging.getLevelNamesMapping():
        raise UserError(f"environment: MYVIEW_LOG: is {level!r}, not DEBUG, INFO, WARNING or ERROR")
    logging.basicConfig(
        stream=sys.stderr,
        level=level,
        format=_FORMAT.replace("%(name)s", name),
        datefmt="%H:%M:%S",
    )
