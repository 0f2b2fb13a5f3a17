"""The base class of targets, which generate inputs and feed them to the code under test."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import ClassVar

_MAX_LENGTH = 2000
"""Longest readable message, characters."""


_IN_MEMORY = Path("/dev/shm")  # noqa: S108 — a temporary folder is created in it


def folder() -> TemporaryDirectory[str]:
    """Create a temporary folder, in memory where possible, for files that are written a million times."""
    return TemporaryDirectory(dir=_IN_MEMORY if _IN_MEMORY.is_dir() else None)


class UnclearError(AssertionError):
    """An input was refused without one readable line."""


class Target(ABC):
    """A reader under test, created once in the process that runs it."""

    name: ClassVar[str]
    messages = 0
    """Number of messages so far: lines, requests, access units or files; by default one per input."""

    @abstractmethod
    def make(self, rng: Random) -> bytes:
        """Return an input: mostly slightly damaged, some valid, some arbitrary."""

    @abstractmethod
    def feed(self, data: bytes) -> bool:
        """Feed an input to the reader; return whether it was accepted, or refused properly.

        Raises:
            Exception: any exception is a crash.
        """

    def hand_over(self, data: bytes) -> bool:
        """Feed an input, and count it."""
        self.messages += 1
        return self.feed(data)

    def close(self) -> None:  # noqa: B027 — most have nothing to close
        """Release resources."""


class ScriptTarget(Target):
    """A target whose inputs have several messages each, which ``feed`` counts."""

    def hand_over(self, data: bytes) -> bool:
        """Feed an input."""
        return self.feed(data)


def refused(error: BaseException | str) -> bool:
    """Return False for a refused input, after checking its error message.

    Raises:
        UnclearError: the message is not one readable line.
    """
    text = str(error)
    if not text or len(text) > _MAX_LENGTH or len(text.splitlines()) > 1 or "Traceback" in text:
        raise UnclearError(f"not a clear line: {text[:200]!r}")
    return False
