"""Errors that are shown to the user as a single line: what, where, and what to do."""

from __future__ import annotations

from typing import ClassVar


class UserError(Exception):
    """Bad input from outside; the command line prints its text as one line and exits with ``code``."""

    code: ClassVar[int] = 2


class UnavailableError(UserError):
    """Something that this process needs is not there now: trying again later may help, and is done."""

    code: ClassVar[int] = 3
