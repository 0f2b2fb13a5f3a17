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

from benchmarks.streaming.simulated_cameras import GOP, SITE
from benchmarks.streaming.stream_site import viewers
from benchmarks.streaming.viewer_crowd import CrowdReading
from benchmarks.streaming.viewing_cost import send_delays
from server.camera.encoder import AccessUnit
from server.media.containers.fmp4 import FragmentSample, fragment

_BACKLOG = 1000


@dataclass(frozen=True, slots=True)
class BareSocketCost:
    """Cost of a loop over the sockets of a number of viewers."""

    viewers: int
    microseconds: float
    """Processor time to send a GOP to a viewer: hardly more than a system call."""
    sent_ms: float
    """Median milliseconds until the last socket has accepted a GOP."""
    delays: tuple[float, float, float]
    """Milliseconds from the start of the loop to when a GOP's end was read: p50, p95, p99."""


def measure_bare_sends(film: Sequence[AccessUnit], count: int, seconds: float) -> BareSocketCost:
    """Send a film's GOPs to `count` viewers in real time."""
    with (
        ExitStack() as stack,
        socket.create_server(("127.0.0.1", 0), backlog=_BACKLOG) as server,
        viewers(server.getsockname()[1]) as crowd,
        ThreadPoolExecutor(1) as pool,
    ):
        watching = pool.submit(crowd.watch, ["/"] * count)
        sockets = [stack.enter_context(server.accept()[0]) for _ in range(count)]
        watching.result()
        pending = pool.submit(crowd.read, seconds)
        sent_gops = list(_send_gops(film, sockets, pending))
        reading = pending.result()
    low, middle, high = np.percentile(
        send_delays(reading, {sent_gop.first: sent_gop.began for sent_gop in sent_gops}), [50, 95, 99]
    )
    return BareSocketCost(
        count,
        1e6 * statistics.median(sent_gop.processor_s for sent_gop in sent_gops) / count,
        1e3 * statistics.median(sent_gop.sent_s for sent_gop in sent_gops),
        (float(low), float(middle), float(high)),
    )


@dataclass(frozen=True, slots=True)
class _SentGop:
    """A GOP that was sent to all sockets: first pulse, start and duration, processor time."""

    first: int
    began: float
    sent_s: float
    processor_s: float


def _send_gops(
    film: Sequence[AccessUnit], sockets: Sequence[socket.socket], pending: Future[CrowdReading]
) -> Iterator[_SentGop]:
    """Send one GOP after another in real time while the viewers read."""
    first = 0
    while not pending.done():
        gop = _gop(film, first)
        began, busy = time.monotonic(), time.thread_time()
        for viewer in sockets:
            viewer.sendall(gop)
        sent_s = time.monotonic() - began
        yield _SentGop(first, began, sent_s, time.thread_time() - busy)
        first += GOP
        time.sleep(max(0.0, GOP / SITE.fps - sent_s))


def _gop(film: Sequence[AccessUnit], first: int) -> bytes:
    units = ((pulse, film[pulse % len(film)]) for pulse in range(first, first + GOP))
    return b"".join(fragment([FragmentSample(unit.data, unit.key)], pulse, SITE.fps) for pulse, unit in units)
