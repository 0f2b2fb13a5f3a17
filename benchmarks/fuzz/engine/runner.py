"""Runs a target on many inputs in a child process, which may hang, leak or die."""

from __future__ import annotations

import gc
import logging
import multiprocessing
import multiprocessing.queues
import re
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType

from benchmarks.fuzz.engine.shared_counts import MAX_INPUT_BYTES, InputCounts, SharedCounts
from benchmarks.fuzz.engine.target import Target

HANG_S = 2.0
"""Processor seconds that one input may take."""
STUCK_S = 60.0
"""Wall-clock seconds after which the process is killed."""
GROWTH_MB = 200
"""Memory growth allowed for one input, megabytes."""
DEAD, MAX_MB = "died", 4096
_KEPT = 3
"""Saved inputs of each kind of crash."""


class HangError(BaseException):
    """An input took too long. Not an Exception, so that the code under test does not swallow it."""


class GrowthError(Exception):
    """An input took too much memory."""


@dataclass(frozen=True, slots=True)
class TargetResult:
    """The result of running a target."""

    counts: InputCounts
    seconds: float
    kinds: int
    """Different crashes, by their place in the code."""


@dataclass(frozen=True, slots=True)
class Crash:
    """A crash: its kind, with the place in the code, and its traceback."""

    kind: str
    text: str


class _TracebackHandler(logging.Handler):
    """Keeps the last logged traceback."""

    def __init__(self) -> None:
        super().__init__()
        self.last: str | None = None

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and record.exc_info[0] is not None:
            self.last = record.getMessage() + "\n" + logging.Formatter().formatException(record.exc_info)


class InputFeeder:
    """Feeds inputs to a target, and detects crashes: exceptions, logged tracebacks, hangs, memory growth."""

    def __init__(self, target: Target, hang_s: float = HANG_S) -> None:
        self.target, self._hang_s = target, hang_s
        self._log = _TracebackHandler()
        self._peak_mb = _read_peak_mb()

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Watch the log and the processor time inside the context."""
        root = logging.getLogger()
        level, handlers, before = root.level, root.handlers[:], signal.signal(signal.SIGPROF, _raise_hang)
        root.handlers[:] = [self._log]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # from excessive numbers
                yield
        finally:
            root.handlers[:] = handlers
            root.setLevel(level)
            signal.signal(signal.SIGPROF, before)

    def feed(self, data: bytes) -> bool | Crash:
        """Feed an input; return whether it was accepted, or the crash."""
        self._log.last = None
        signal.setitimer(signal.ITIMER_PROF, self._hang_s)
        try:
            accepted = self.target.hand_over(data)
            signal.setitimer(signal.ITIMER_PROF, 0)
            if self._log.last is not None:
                return Crash(_logged(self._log.last), self._log.last)
            self._check_growth()
        except (Exception, HangError) as error:  # noqa: BLE001 — anything is a crash
            signal.setitimer(signal.ITIMER_PROF, 0)
            self._peak_mb = _read_peak_mb()
            return Crash(_kind(error), "".join(traceback.format_exception(error)))
        return accepted

    def _check_growth(self) -> None:
        most = _read_peak_mb()
        growth, self._peak_mb = most - self._peak_mb, most
        if growth > GROWTH_MB:
            raise GrowthError(f"{growth} MB more")


def _read_peak_mb() -> int:
    """Return the peak resident memory of the process, megabytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _raise_hang(_: int, __: FrameType | None) -> None:
    raise HangError("took too long")


def _kind(error: BaseException) -> str:
    """Name a crash by its exception and place in the code, which identify its cause."""
    frames = traceback.extract_tb(error.__traceback__)
    own_frames = [
        frame for frame in frames if "site-packages" not in frame.filename and "fuzz_" not in frame.filename
    ]
    place = own_frames[-1] if own_frames else frames[-1] if frames else None
    where = "" if place is None else f"{Path(place.filename).stem}-{place.name.strip('<>')}"
    return f"{type(error).__name__}-{where}"


def _logged(text: str) -> str:
    """Name a crash by a logged traceback."""
    places = re.findall(r'File ".*/([^/"]+)\.py", line \d+, in (\w+)', text)
    where = "-".join(places[-1]) if places else ""
    return f"logged-{where}"


@dataclass(frozen=True, slots=True)
class FuzzPlan:
    """The inputs to run, and the bounds; the first bound that is reached ends the run."""

    inputs: int | None = None
    seconds: float | None = None
    seed: int = 1
    out: Path | None = None
    """The folder for crashes; None: do not save them."""
    hang_s: float = HANG_S
    messages: int | None = None
    first: int = 0
    """The number of the first input."""

    def done(self, counts: InputCounts) -> bool:
        """Return whether a bound is reached."""
        return any(
            limit is not None and count >= limit
            for count, limit in ((counts.inputs, self.inputs), (counts.messages, self.messages))
        )


def make_input(target: Target, seed: int, index: int) -> bytes:
    """Return the input of this number, the same in every run."""
    return target.make(Random(seed << 48 | index))


class TargetRunner:
    """Runs a target, counts the outcomes and saves the crashes."""

    def __init__(self, make: Callable[[], Target], name: str, plan: FuzzPlan) -> None:
        self._make, self._name, self._plan = make, name, plan
        self._kinds: dict[str, int] = {}

    def run(self) -> TargetResult:
        """Run the target in child processes, replacing those that die or leak."""
        began = time.monotonic()
        shared, fork, counts = SharedCounts(), multiprocessing.get_context("fork"), InputCounts()
        until = None if self._plan.seconds is None else began + self._plan.seconds
        while not self._plan.done(counts) and (
            not counts.inputs or until is None or time.monotonic() < until
        ):
            kinds = fork.SimpleQueue()
            child = fork.Process(target=self._child, args=(shared, until, kinds))
            child.start()
            death = self._wait(child, shared)
            while not kinds.empty():
                self._count(kinds.get())
            counts = shared.counts
            if death is not None:
                self._save(Crash(f"{DEAD}-{death}", f"the process {death}"), counts.inputs, shared.data)
                counts.inputs, counts.messages, counts.crashes = (
                    count + 1 for count in (counts.inputs, counts.messages, counts.crashes)
                )
                shared.store(counts)
        return TargetResult(counts, time.monotonic() - began, len(self._kinds))

    def _wait(self, child: multiprocessing.process.BaseProcess, shared: SharedCounts) -> str | None:
        """Wait for a process; return how it died, or None if it exited normally."""
        last, since = -1, time.monotonic()
        while child.is_alive():
            child.join(1.0)
            inputs = shared.counts.inputs
            if inputs != last:
                last, since = inputs, time.monotonic()
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
        self, shared: SharedCounts, until: float | None, kinds: multiprocessing.queues.SimpleQueue[str]
    ) -> None:
        counts = shared.counts
        resource.setrlimit(resource.RLIMIT_AS, (MAX_MB << 20, MAX_MB << 20))
        target = self._make()
        feeder, first, growth = InputFeeder(target, self._plan.hang_s), counts.inputs, False
        before = counts.messages - target.messages
        gc.freeze()
        with feeder.watching():
            while not growth and not self._plan.done(counts):
                if until is not None and time.monotonic() > until and counts.inputs > first:
                    break
                data = make_input(target, self._plan.seed, self._plan.first + counts.inputs)[:MAX_INPUT_BYTES]
                shared.store(counts, data)
                match feeder.feed(data):
                    case Crash() as crash:
                        counts.crashes += 1
                        self._save(crash, counts.inputs, data)
                        if self._kinds[crash.kind] <= _KEPT:
                            kinds.put(crash.kind)
                        growth = crash.kind.startswith(GrowthError.__name__)  # its memory is not freed
                    case True:
                        counts.accepted += 1
                    case _:
                        counts.refused += 1
                counts.inputs += 1
                counts.messages = before + target.messages
        shared.store(counts)
        target.close()

    def _count(self, kind: str) -> int:
        count = self._kinds[kind] = self._kinds.get(kind, 0) + 1
        return count

    def _save(self, crash: Crash, place: int, data: bytes) -> None:
        """Save a crash, up to a limit for each kind, by the input's number."""
        count = self._count(crash.kind)
        if self._plan.out is not None and count <= _KEPT:
            self._plan.out.mkdir(parents=True, exist_ok=True)
            stem = f"{self._name}.{crash.kind}.{self._plan.first + place}"
            (self._plan.out / f"{stem}.bin").write_bytes(data)
            (self._plan.out / f"{stem}.txt").write_text(crash.text, encoding="utf-8", errors="replace")
