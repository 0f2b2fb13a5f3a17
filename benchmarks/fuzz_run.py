"""Running a target over many inputs, in a process of its own, which may hang, grow or die."""

from __future__ import annotations

import gc
import logging
import mmap
import multiprocessing
import multiprocessing.queues
import re
import resource
import signal
import struct
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType

from benchmarks.fuzz_target import Target

HANG_S = 2.0
"""Processor time that one input may take."""
STUCK_S = 60.0
"""The same by the clock, however busy the machine: then the process is killed."""
GROWTH_MB = 200
"""Megabytes that the process may grow by within one input."""
DEAD, MOST_MB = "died", 4096
_KEPT = 3
"""Inputs that are saved of each kind of crash."""
_ROOM = 1 << 20
_HEAD = struct.Struct("<5Q")
"""The number of the input, how many were refused, accepted and crashed, and the bytes that follow."""


class HangError(BaseException):
    """An input took too long. No Exception: the code under test may not swallow it."""


class GrowthError(Exception):
    """An input took too much memory."""


@dataclass(slots=True)
class Tally:
    """What came of a target's inputs."""

    inputs: int = 0
    refused: int = 0
    accepted: int = 0
    crashes: int = 0
    seconds: float = 0.0
    kinds: int = 0
    """Of crashes, by the place in the code."""


@dataclass(frozen=True, slots=True)
class Crash:
    """What happened, and where."""

    kind: str
    text: str


class _Tracebacks(logging.Handler):
    """Keeps the last traceback that was logged."""

    def __init__(self) -> None:
        super().__init__()
        self.last: str | None = None

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and record.exc_info[0] is not None:
            self.last = record.getMessage() + "\n" + logging.Formatter().formatException(record.exc_info)


class Attempt:
    """Feeds inputs one by one, and tells what is wrong: what is raised, logged, too slow or too large."""

    def __init__(self, target: Target, hang_s: float = HANG_S) -> None:
        self.target, self._hang_s = target, hang_s
        self._log = _Tracebacks()
        self._most = _most_mb()

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Watch the log and the time meanwhile."""
        root = logging.getLogger()
        level, handlers, before = root.level, root.handlers[:], signal.signal(signal.SIGPROF, _hung)
        root.handlers[:] = [self._log]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # numbers that are too large, and told so
                yield
        finally:
            root.handlers[:] = handlers
            root.setLevel(level)
            signal.signal(signal.SIGPROF, before)

    def feed(self, data: bytes) -> bool | Crash:
        """Give whether an input was taken; a crash where there was one."""
        self._log.last = None
        signal.setitimer(signal.ITIMER_PROF, self._hang_s)
        try:
            taken = self.target.feed(data)
            signal.setitimer(signal.ITIMER_PROF, 0)
            if self._log.last is not None:
                return Crash(_logged(self._log.last), self._log.last)
            self._weigh()
        except (Exception, HangError) as error:  # noqa: BLE001 — whatever it is, it is a crash
            signal.setitimer(signal.ITIMER_PROF, 0)
            self._most = _most_mb()
            return Crash(_kind(error), "".join(traceback.format_exception(error)))
        return taken

    def _weigh(self) -> None:
        most = _most_mb()
        grown, self._most = most - self._most, most
        if grown > GROWTH_MB:
            raise GrowthError(f"{grown} MB more")


def _most_mb() -> int:
    """Give the most megabytes that the process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _hung(_: int, __: FrameType | None) -> None:
    raise HangError("took too long")


def _kind(error: BaseException) -> str:
    """Name a crash by what was raised and where: crashes of one kind are one mistake."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [it for it in frames if "site-packages" not in it.filename and "fuzz_" not in it.filename]
    place = ours[-1] if ours else frames[-1] if frames else None
    where = "" if place is None else f"{Path(place.filename).stem}-{place.name.strip('<>')}"
    return f"{type(error).__name__}-{where}"


def _logged(text: str) -> str:
    """Name a crash whose traceback was not raised, but logged."""
    places = re.findall(r'File ".*/([^/"]+)\.py", line \d+, in (\w+)', text)
    where = "-".join(places[-1]) if places else ""
    return f"logged-{where}"


@dataclass(frozen=True, slots=True)
class Plan:
    """How long and with what."""

    inputs: int
    seconds: float | None = None
    seed: int = 1
    out: Path | None = None
    """Where crashes are saved; None: nowhere."""
    hang_s: float = HANG_S


def numbered(target: Target, seed: int, index: int) -> bytes:
    """Give the input of this number: the same in every run."""
    return target.make(Random(seed << 48 | index))


class Runner:
    """Counts and saves what comes of a target's inputs."""

    def __init__(self, make: Callable[[], Target], name: str, plan: Plan) -> None:
        self._make, self._name, self._plan = make, name, plan
        self._kinds: dict[str, int] = {}

    def run(self) -> Tally:
        """Run it in processes of its own; one that dies or grows is followed by another."""
        began = time.monotonic()
        shared, fork = mmap.mmap(-1, _HEAD.size + _ROOM), multiprocessing.get_context("fork")
        until = None if self._plan.seconds is None else began + self._plan.seconds
        index, refused, accepted, crashes = 0, 0, 0, 0
        while index < self._plan.inputs and (index == 0 or until is None or time.monotonic() < until):
            kinds = fork.SimpleQueue()
            child = fork.Process(target=self._child, args=(shared, until, kinds))
            child.start()
            died = self._wait(child, shared)
            while not kinds.empty():
                self._count(kinds.get())
            index, refused, accepted, crashes, size = _HEAD.unpack_from(shared)
            if died is not None:
                crash = Crash(f"{DEAD}-{died}", f"the process {died}")
                self._save(crash, shared[_HEAD.size : _HEAD.size + size])
                index, crashes = index + 1, crashes + 1
                _HEAD.pack_into(shared, 0, index, refused, accepted, crashes, 0)
            elif not size:
                break
        return Tally(index, refused, accepted, crashes, time.monotonic() - began, len(self._kinds))

    def _wait(self, child: multiprocessing.process.BaseProcess, shared: mmap.mmap) -> str | None:
        """Wait for a process; say how it died, None where it did not."""
        last, since = -1, time.monotonic()
        while child.is_alive():
            child.join(1.0)
            index = _HEAD.unpack_from(shared)[0]
            if index != last:
                last, since = index, time.monotonic()
            elif time.monotonic() - since > STUCK_S:
                child.kill()
                child.join()
                return "stuck"
        if child.exitcode is not None and child.exitcode < 0:
            return f"signal-{-child.exitcode}"
        if child.exitcode:
            raise RuntimeError(f"{self._name}: the fuzzing itself failed; see above")
        return None

    def _child(
        self, shared: mmap.mmap, until: float | None, kinds: multiprocessing.queues.SimpleQueue[str]
    ) -> None:
        index, refused, accepted, crashes, _ = _HEAD.unpack_from(shared)
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MB << 20, MOST_MB << 20))
        target = self._make()
        attempt, begun, grown = Attempt(target, self._plan.hang_s), index, 0
        gc.freeze()
        with attempt.watching():
            while not grown and index < self._plan.inputs:
                if until is not None and time.monotonic() > until and index > begun:
                    break
                data = numbered(target, self._plan.seed, index)[:_ROOM]
                shared[_HEAD.size : _HEAD.size + len(data)] = data
                _HEAD.pack_into(shared, 0, index, refused, accepted, crashes, len(data))
                match attempt.feed(data):
                    case Crash() as crash:
                        crashes += 1
                        self._save(crash, data)
                        if self._kinds[crash.kind] <= _KEPT:
                            kinds.put(crash.kind)
                        grown = int(crash.kind.startswith(GrowthError.__name__))  # what it had it keeps
                    case True:
                        accepted += 1
                    case _:
                        refused += 1
                index += 1
        _HEAD.pack_into(shared, 0, index, refused, accepted, crashes, grown)
        target.close()

    def _count(self, kind: str) -> int:
        count = self._kinds[kind] = self._kinds.get(kind, 0) + 1
        return count

    def _save(self, crash: Crash, data: bytes) -> None:
        """Save what crashed, some of each kind."""
        count = self._count(crash.kind)
        if self._plan.out is not None and count <= _KEPT:
            self._plan.out.mkdir(parents=True, exist_ok=True)
            stem = f"{self._name}.{crash.kind}.{count}"
            (self._plan.out / f"{stem}.bin").write_bytes(data)
            (self._plan.out / f"{stem}.txt").write_text(crash.text, encoding="utf-8", errors="replace")
