"""Processor time by stage, measured around public methods of the real classes."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

Watched = tuple[type | ModuleType, str, str]
"""A class or module, the name of its function, and the name of the stage."""


class Stopwatch:
    """Adds up the seconds of each stage, without those of stages called from it.

    Time is the processor time of the process, which includes a library's own threads.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner: list[float] = []
        """For each running stage, outermost first: seconds of the stages inside it."""

    @contextmanager
    def watching(self, *watched: Watched) -> Iterator[None]:
        """Time these functions inside the context."""
        originals = [(owner, name, getattr(owner, name)) for owner, name, _ in watched]
        for owner, name, stage in watched:
            setattr(owner, name, self._timed(getattr(owner, name), stage))
        try:
            yield
        finally:
            for owner, name, original in originals:
                setattr(owner, name, original)

    def _timed(self, method: Callable[..., Any], stage: str) -> Callable[..., Any]:
        self.seconds.setdefault(stage, 0.0)

        @functools.wraps(method)
        def run(*args: Any, **kwargs: Any) -> Any:
            self._inner.append(0.0)
            start = time.process_time()
            try:
                return method(*args, **kwargs)
            finally:
                spent = time.process_time() - start
                self.seconds[stage] += spent - self._inner.pop()
                if self._inner:
                    self._inner[-1] += spent

        return run
