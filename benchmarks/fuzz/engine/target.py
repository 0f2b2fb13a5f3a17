"""What is fuzzed: something that makes inputs, and hands them to code that reads bytes from outside."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import ClassVar

_LONGEST = 2000
"""Characters of a message that is still one that somebody reads."""


_IN_MEMORY = Path("/dev/shm")  # noqa: S108 — a folder of ours is made in it


def folder() -> TemporaryDirectory[str]:
    """Make a folder for files that are written a million times: in memory, where the system has such."""
    return TemporaryDirectory(dir=_IN_MEMORY if _IN_MEMORY.is_dir() else None)


class UnclearError(AssertionError):
    """An input was refused, but not in one readable line."""


class Target(ABC):
    """One reader. Made in the process that runs it, once for many inputs."""

    name: ClassVar[str]
    messages = 0
    """That the reader was given so far: lines, messages, requests, access units, files; whatever it reads one
    by one. Here an input is one."""

    @abstractmethod
    def make(self, rng: Random) -> bytes:
        """Return an input: most are nearly right, some are right, some are anything."""

    @abstractmethod
    def feed(self, data: bytes) -> bool:
        """Hand an input to the reader; say whether it was taken, or refused as it should be.

        Raises:
            Exception: anything at all, which is a crash.
        """

    def hand_over(self, data: bytes) -> bool:
        """Feed an input, and count it."""
        self.messages += 1
        return self.feed(data)

    def close(self) -> None:  # noqa: B027 — most have opened nothing
        """Let go of what was opened."""


class ScriptTarget(Target):
    """A reader whose inputs are several messages each: ``feed`` counts them as it hands them over."""

    def hand_over(self, data: bytes) -> bool:
        """Feed an input."""
        return self.feed(data)


def refused(error: BaseException | str) -> bool:
    """Return that an input was refused, having seen that a person can read why.

    Raises:
        UnclearError: it is no line, or none that can be read.
    """
    text = str(error)
    if not text or len(text) > _LONGEST or len(text.splitlines()) > 1 or "Traceback" in text:
        raise UnclearError(f"not a clear line: {text[:200]!r}")
    return False
