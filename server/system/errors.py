"""Errors that are shown to the user as one line: what, where, and what to do."""

from __future__ import annotations

from typing import ClassVar


class UserError(Exception):
    """Invalid input; the command line prints its text as one line and exits with ``code``."""

    code: ClassVar[int] = 2


class UnavailableError(UserError):
    """Something that this process needs is unavailable now; a supervisor starts the process again."""

    code: ClassVar[int] = 3
