"""Samples of a soak test, and the check that the last quarter of the time is like the second."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_MEGABYTE = 1e6


@dataclass(frozen=True, slots=True)
class ProcessSample:
    """A process at one moment.

    Attributes:
        hours: of the site's time.
        resident: resident memory, megabytes.
        descriptors: open file descriptors.
        threads: of the process.
        tasks: of its event loop.
        blocks: memory blocks of Python's allocator.
    """

    hours: float
    resident: float
    descriptors: int
    threads: int
    tasks: int
    blocks: int


@dataclass(frozen=True, slots=True)
class GrowthRule:
    """How much a quantity may grow from the second quarter to the fourth.

    Attributes:
        name: of the quantity.
        share: allowed growth as a share.
        extra: allowed growth besides, in the quantity's unit.
        quantile: of a quarter's samples that is compared.
    """

    name: str
    share: float
    extra: float
    quantile: float = 0.5

    def judge(self, hours: Sequence[float], values: Sequence[float]) -> GrowthVerdict:
        """Compare the second and the fourth quarter of the time; the first is the warm-up.

        A quarter without samples is NaN, which is not flat.
        """
        whole = max(hours, default=0.0) or 1.0
        quarters = np.minimum(3, (4 * np.asarray(hours) / whole).astype(int))
        numbers: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
        second, fourth = (self._of(numbers[quarters == quarter]) for quarter in (1, 3))
        return GrowthVerdict(self, second, fourth)

    def _of(self, samples: NDArray[np.float64]) -> float:
        return float(np.quantile(samples, self.quantile)) if len(samples) else np.nan


@dataclass(frozen=True, slots=True)
class GrowthVerdict:
    """The values of a quantity in the second and the fourth quarter."""

    rule: GrowthRule
    second: float
    fourth: float

    @property
    def flat(self) -> bool:
        """Whether the growth is within the rule."""
        return self.fourth <= self.second * (1.0 + self.rule.share) + self.rule.extra


RESIDENT = GrowthRule("memory, MB", 0.05, 0.0)
DESCRIPTORS = GrowthRule("descriptors", 0.0, 2.0)
THREADS = GrowthRule("threads", 0.0, 1.0)
"""One more is allowed: the bus starts and ends threads."""
TASKS = GrowthRule("tasks", 0.0, 2.0)
DELAY = GrowthRule("delay, ms", 0.10, 50.0, 0.1)
"""Other load on the machine varies, so the best tenth of the delays is compared."""


def resident_of(pid: int) -> float:
    """Return the resident memory of a process, megabytes (Linux).

    Raises:
        OSError: there is no such process.
    """
    pages = int((Path("/proc") / str(pid) / "statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / _MEGABYTE


def descriptors_of(pid: int) -> int:
    """Return the number of open files and sockets of a process.

    Raises:
        OSError: there is no such process.
    """
    return len(os.listdir(f"/proc/{pid}/fd"))  # noqa: PTH208 — names are only counted


def threads_of(pid: int) -> int:
    """Return the number of threads of a process.

    Raises:
        OSError: there is no such process.
    """
    return len(os.listdir(f"/proc/{pid}/task"))  # noqa: PTH208 — likewise


def judge(samples: Sequence[ProcessSample]) -> list[GrowthVerdict]:
    """Check the growth of all quantities of a process."""
    hours = [sample.hours for sample in samples]
    return [
        RESIDENT.judge(hours, [sample.resident for sample in samples]),
        DESCRIPTORS.judge(hours, [sample.descriptors for sample in samples]),
        THREADS.judge(hours, [sample.threads for sample in samples]),
        TASKS.judge(hours, [sample.tasks for sample in samples]),
    ]
