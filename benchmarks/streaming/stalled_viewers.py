"""Stalled viewers, who never read: their effect on others, measured with and without them in turn."""

from __future__ import annotations

import contextlib
import socket
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.report import Report
from benchmarks.streaming.simulated_cameras import ENCODE, SITE
from benchmarks.streaming.stream_site import StreamSite, ViewerProcess
from benchmarks.streaming.viewing_cost import send_delays
from server.media.rendering_messages import TIMESCALE

STALLED_SHARE = 0.1
"""Of all viewers."""
_FILL_S = 4.0
"""Seconds until the system's buffers are full, so that the server must drop GOPs."""
_LEAVE_S = 1.0
_TRIES, _LEAST_GOPS = 10, 3
_BUFFER = 4096
"""Receive buffer of a stalled viewer, bytes."""


@dataclass(frozen=True, slots=True)
class ReadingRound:
    """The delays of the reading viewers in one round.

    Attributes:
        p50: milliseconds from when a GOP was sent to when its end was read.
        p99: likewise.
        arrived: share of the GOPs that were received.
        cores: used by the best-view process, including work for stalled viewers.
    """

    p50: float
    p99: float
    arrived: float
    cores: float


@dataclass(frozen=True, slots=True)
class StallComparison:
    """The reading viewers without and with stalled ones; round by round.

    Attributes:
        good: reading viewers.
        stalled: stalled viewers.
    """

    good: int
    stalled: int
    alone: list[ReadingRound]
    beside: list[ReadingRound]

    @property
    def ratio(self) -> float:
        """The p99 with stalled viewers divided by that without: medians over rounds."""
        alone, beside = (statistics.median(turn.p99 for turn in turns) for turns in (self.alone, self.beside))
        return beside / alone


def beside_stalled(
    site: StreamSite, crowd: ViewerProcess, numbers: Sequence[int], viewers: int, seconds: float, rounds: int
) -> StallComparison:
    """Measure reading viewers with and without stalled ones; the order alternates."""
    stalled = round(STALLED_SHARE * viewers)
    good = viewers - stalled
    paths = [f"/objects/{numbers[place % len(numbers)]}/best.mp4" for place in range(good)]
    crowd.watch(paths, _FILL_S)
    alone, beside = [], []
    for number in range(rounds):
        if number % 2 == 0:
            alone.append(_turn(site, crowd, good, seconds))
        with stalling(site.http, paths[:stalled]):
            crowd.read(_FILL_S)
            beside.append(_turn(site, crowd, good, seconds))
        crowd.read(_LEAVE_S)
        if number % 2:
            alone.append(_turn(site, crowd, good, seconds))
    crowd.watch([])
    return StallComparison(good, stalled, alone, beside)


def _turn(site: StreamSite, crowd: ViewerProcess, good: int, seconds: float) -> ReadingRound:
    """Read for a while; longer where the machine is so busy that hardly a GOP arrives.

    Raises:
        RuntimeError: too few GOPs arrive.
    """
    before, passed = site.used, 0.0
    ticks: list[int] = []
    delays: list[NDArray[np.float64]] = []
    for _ in range(_TRIES):
        heard = crowd.read(seconds)
        ticks += heard.ticks
        delays.append(send_delays(heard, {first: sent_gop.began for first, sent_gop in site.sent.items()}))
        passed += heard.seconds
        times, counts = np.unique(ticks, return_counts=True)
        ends = np.rint(times * SITE.fps / TIMESCALE).astype(int) % ENCODE.gop == ENCODE.gop - 1
        whole = counts[ends][1:-1]  # the first and the last are incomplete
        if len(whole) >= _LEAST_GOPS:
            p50, p99 = np.percentile(np.concatenate(delays), [50, 99]).tolist()
            return ReadingRound(p50, p99, float(whole.mean()) / good, (site.used - before) / passed)
    raise RuntimeError(f"{len(whole)} GOPs came in {passed:.0f} s: the machine is too busy to measure this")


@contextlib.contextmanager
def stalling(port: int, paths: Sequence[str]) -> Iterator[list[socket.socket]]:
    """Open stalled viewers, which request a stream each and never read."""
    with contextlib.ExitStack() as stack:
        found = []
        for path in paths:
            viewer = stack.enter_context(socket.socket())
            viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            viewer.connect(("127.0.0.1", port))
            viewer.sendall(f"GET {path} HTTP/1.1\r\nHost: here\r\n\r\n".encode())
            found.append(viewer)
        yield found


def describe_stalled(report: Report, found: StallComparison) -> None:
    """Print the rounds, and their medians."""
    rows = [
        [str(number), *(_cell(column, alone, beside) for column in _COLUMNS)]
        for number, (alone, beside) in enumerate(zip(found.alone, found.beside, strict=True), 1)
    ]
    report.table(
        f"{found.good} viewers alone / with {found.stalled} stalled ones: ms until a GOP has arrived",
        ["round", "p50", "p99", "arrived", "cores of the service"],
        rows,
    )
    report.line(f"p99 with stalled viewers / without: {found.ratio:.2f} (medians over rounds)")
    alone, beside = (statistics.median(turn.cores for turn in turns) for turns in (found.alone, found.beside))
    report.line(f"cores of the service: {beside:.3f} with, {alone:.3f} without (likewise)")


_COLUMNS = {"p50": 1, "p99": 1, "arrived": 3, "cores": 2}
"""Columns with their number of digits."""


def _cell(name: str, alone: ReadingRound, beside: ReadingRound) -> str:
    digits = _COLUMNS[name]
    return f"{getattr(alone, name):.{digits}f} / {getattr(beside, name):.{digits}f}"
