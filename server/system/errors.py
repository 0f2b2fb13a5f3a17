"""Errors that are shown to the user as one line: what, where, and what to do; and why others happened."""

from __future__ import annotations

import os
from typing import ClassVar


class UserError(Exception):
    """Invalid input; the command line prints its text as one line and exits with ``code``."""

    code: ClassVar[int] = 2


class UnavailableError(UserError):
    """Something that this process needs is unavailable now; a supervisor starts the process again."""

    code: ClassVar[int] = 3


def reason_of(error: BaseException, otherwise: str = "") -> str:
    """Return in one line why something failed, without the file: in the words of the system or of FFmpeg.

    ``otherwise`` replaces other errors' texts, which may repeat what was read.
    """
    reason = getattr(error, "strerror", None)
    if (
        isinstance(error, OSError)
        and error.errno
        and str(reason).startswith("error while attempting to bind")
    ):
        reason = os.strerror(error.errno)  # asyncio's text repeats the address
    if isinstance(error, UnicodeDecodeError):
        reason = otherwise or f"it is not {error.encoding.upper()} text"
    return " ".join(str(reason or otherwise or error).split()) or type(error).__name__
