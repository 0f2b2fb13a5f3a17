"""The minimal cost of viewers: GOPs sent to sockets in a plain loop."""

from __future__ import annotations

import socket
import statistics
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from benchmarks.streaming.simulated_cameras import ENCODE, SITE
from benchmarks.streaming.stream_site import viewers
from benchmarks.streaming.viewer_crowd import CrowdReading
from benchmarks.streaming.viewing_cost import send_delays
from server.camera.encoding.encoder import AccessUnit
from server.media.containers.fmp4 import FragmentSample, fragment

_BACKLOG = 1000


@dataclass(frozen=True, slots=True)
class BareSocketCost:
    """Cost of a loop over the sockets of a number of viewers."""

    viewers: int
    each: float
    """Microseconds of processor time for a viewer's GOP: hardly more than a system call."""
    given: float
    """Median milliseconds until the last socket has accepted a GOP."""
    delays: tuple[float, float, float]
    """Milliseconds from the start of the loop to when a GOP's end was read: p50, p95, p99."""


def bare_sends(film: Sequence[AccessUnit], count: int, seconds: float) -> BareSocketCost:
    """Send a film's GOPs to `count` viewers in real time."""
    with (
        ExitStack() as open_ones,
        socket.create_server(("127.0.0.1", 0), backlog=_BACKLOG) as server,
        viewers(server.getsockname()[1]) as crowd,
        ThreadPoolExecutor(1) as aside,
    ):
        watching = aside.submit(crowd.watch, ["/"] * count)
        sockets = [open_ones.enter_context(server.accept()[0]) for _ in range(count)]
        watching.result()
        hearing = aside.submit(crowd.read, seconds)
        rounds = list(_rounds(film, sockets, hearing))
        heard = hearing.result()
    low, middle, high = np.percentile(
        send_delays(heard, {sending.first: sending.began for sending in rounds}), [50, 95, 99]
    )
    return BareSocketCost(
        count,
        1e6 * statistics.median(sending.busy for sending in rounds) / count,
        1e3 * statistics.median(sending.given for sending in rounds),
        (float(low), float(middle), float(high)),
    )


@dataclass(frozen=True, slots=True)
class _Round:
    first: int
    began: float
    given: float
    busy: float


def _rounds(
    film: Sequence[AccessUnit], sockets: Sequence[socket.socket], hearing: Future[CrowdReading]
) -> Iterator[_Round]:
    """Send GOP after GOP while the viewers read."""
    first = 0
    while not hearing.done():
        gop = _gop(film, first)
        began, busy = time.monotonic(), time.thread_time()
        for viewer in sockets:
            viewer.sendall(gop)
        given = time.monotonic() - began
        yield _Round(first, began, given, time.thread_time() - busy)
        first += ENCODE.gop
        time.sleep(max(0.0, ENCODE.gop / SITE.fps - given))


def _gop(film: Sequence[AccessUnit], first: int) -> bytes:
    units = ((pulse, film[pulse % len(film)]) for pulse in range(first, first + ENCODE.gop))
    return b"".join(fragment([FragmentSample(unit.data, unit.key)], pulse, SITE.fps) for pulse, unit in units)
