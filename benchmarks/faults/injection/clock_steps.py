"""Clock steps of an hour, by a preloaded library that shifts the clock of all processes of a site."""

from __future__ import annotations

import asyncio
import contextlib
import mmap
import shutil
import struct
import time
from collections.abc import AsyncIterator
from pathlib import Path

from benchmarks.common.environment import CannotRunError
from benchmarks.faults.site.fault_site import Fault, FaultSite, Inject, with_up
from benchmarks.faults.video.stamped_views import StampedViews
from client import site

_HOUR_S = 3600
_EXACT_S = 60.0
_SHIM = r"""
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static volatile long long *ahead;

__attribute__((constructor)) static void find(void) {
    const char *path = getenv("FAULTS_CLOCK");
    int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (file < 0) return;
    void *found = mmap(0, sizeof *ahead, PROT_READ, MAP_SHARED, file, 0);
    if (found != MAP_FAILED) ahead = found;
    close(file);
}

int clock_gettime(clockid_t id, struct timespec *now) {
    int failed = syscall(SYS_clock_gettime, id, now);
    if (!failed && ahead && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) now->tv_sec += *ahead;
    return failed;
}

int gettimeofday(struct timeval *now, void *zone) {
    struct timespec exact;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *now) {
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (now) *now = exact.tv_sec;
    return exact.tv_sec;
}
"""


class ClockOffset:
    """The shared offset of the site's clock, seconds."""

    def __init__(self, path: Path) -> None:
        path.write_bytes(struct.pack("q", 0))
        with path.open("r+b") as file:
            self._shared = mmap.mmap(file.fileno(), struct.calcsize("q"))

    def step(self, seconds: int) -> None:
        """Step the clock by some seconds; negative: back."""
        (ahead,) = struct.unpack("q", self._shared[:])
        self._shared[:] = struct.pack("q", ahead + seconds)


@contextlib.asynccontextmanager
async def with_clock(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run a site whose clock can be stepped.

    Raises:
        CannotRunError: gcc is missing, or fails.
    """
    gcc = shutil.which("gcc")
    if gcc is None:
        raise CannotRunError("stepping the clock needs gcc")
    shim, source, shared = folder / "clock.so", folder / "clock.c", folder / "clock"
    await asyncio.to_thread(source.write_text, _SHIM, encoding="ascii")
    compiling = await asyncio.create_subprocess_exec(
        gcc, "-O2", "-shared", "-fPIC", "-o", str(shim), str(source)
    )
    if await compiling.wait():
        raise CannotRunError("gcc could not compile the clock library")
    clock = await asyncio.to_thread(ClockOffset, shared)
    environment = {"LD_PRELOAD": str(shim), "FAULTS_CLOCK": str(shared)}
    async with with_up(views, folder, environment=environment) as fault_site:
        fault_site.control = clock
        yield fault_site


def step_clock(seconds: int) -> Inject:
    """Step the clock of all processes."""

    async def inject(fault_site: FaultSite) -> None:
        before = (await site(fault_site.url)).now - time.time()
        fault_site.control.step(seconds)
        after = (await site(fault_site.url)).now - time.time()
        if abs(after - before - seconds) > _EXACT_S:
            raise RuntimeError("the server's clock did not step")

    return inject


FAULTS = (
    Fault("clock an hour ahead", with_clock, step_clock(_HOUR_S), 8.0),
    Fault("clock an hour back", with_clock, step_clock(-_HOUR_S), 8.0),
)
