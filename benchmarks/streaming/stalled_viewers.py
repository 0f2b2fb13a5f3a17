"""Effect on reading viewers of stalled ones, which never read; measured alternately with and without them."""

from __future__ import annotations

import contextlib
import socket
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.report import Report
from benchmarks.streaming.simulated_cameras import GOP, SITE
from benchmarks.streaming.stream_site import StreamSite, ViewerProcess
from benchmarks.streaming.viewing_cost import send_delays
from server.media.rendering_messages import TIMESCALE

STALLED_SHARE = 0.1
"""Of all viewers."""
_FILL_S = 4.0
"""Seconds until the system's buffers are full, so that the server must drop GOPs."""
_LEAVE_S = 1.0
_TRIES, _MIN_GOPS = 10, 3
_BUFFER = 4096
"""Receive buffer of a stalled viewer, bytes."""


@dataclass(frozen=True, slots=True)
class ReadingRound:
    """The delays of the reading viewers in one round.

    Attributes:
        p50: median milliseconds from sending a GOP until its end was read.
        p99: the 99th percentile.
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
        readers: number of reading viewers.
        stalled: number of stalled viewers.
    """

    readers: int
    stalled: int
    without_stalled: list[ReadingRound]
    with_stalled: list[ReadingRound]

    @property
    def ratio(self) -> float:
        """The median p99 over rounds with stalled viewers, divided by that without."""
        without, with_ = (
            statistics.median(reading_round.p99 for reading_round in rounds)
            for rounds in (self.without_stalled, self.with_stalled)
        )
        return with_ / without


def compare_stalled(
    site: StreamSite, crowd: ViewerProcess, numbers: Sequence[int], viewers: int, seconds: float, rounds: int
) -> StallComparison:
    """Measure reading viewers with and without stalled ones; the order alternates."""
    stalled = round(STALLED_SHARE * viewers)
    readers = viewers - stalled
    paths = [f"/objects/{numbers[place % len(numbers)]}/best.mp4" for place in range(readers)]
    crowd.watch(paths, _FILL_S)
    without, with_ = [], []
    for number in range(rounds):
        if number % 2 == 0:
            without.append(_measure_round(site, crowd, readers, seconds))
        with open_stalled_viewers(site.http, paths[:stalled]):
            crowd.read(_FILL_S)
            with_.append(_measure_round(site, crowd, readers, seconds))
        crowd.read(_LEAVE_S)
        if number % 2:
            without.append(_measure_round(site, crowd, readers, seconds))
    crowd.watch([])
    return StallComparison(readers, stalled, without, with_)


def _measure_round(site: StreamSite, crowd: ViewerProcess, readers: int, seconds: float) -> ReadingRound:
    """Read until enough GOPs have arrived, which takes longer on a busy machine.

    Raises:
        RuntimeError: too few GOPs arrive.
    """
    before, read_s = site.processor_seconds, 0.0
    ticks: list[int] = []
    delays: list[NDArray[np.float64]] = []
    for _ in range(_TRIES):
        reading = crowd.read(seconds)
        ticks += reading.ticks
        delays.append(send_delays(reading, {first: sent_gop.began for first, sent_gop in site.sent.items()}))
        read_s += reading.seconds
        times, counts = np.unique(ticks, return_counts=True)
        ends = np.rint(times * SITE.fps / TIMESCALE).astype(int) % GOP == GOP - 1
        received = counts[ends][1:-1]  # the first and the last are incomplete
        if len(received) >= _MIN_GOPS:
            p50, p99 = np.percentile(np.concatenate(delays), [50, 99]).tolist()
            return ReadingRound(
                p50, p99, float(received.mean()) / readers, (site.processor_seconds - before) / read_s
            )
    raise RuntimeError(
        f"{len(received)} GOPs arrived in {read_s:.0f} s: the machine is too busy to measure this"
    )


@contextlib.contextmanager
def open_stalled_viewers(port: int, paths: Sequence[str]) -> Iterator[list[socket.socket]]:
    """Open stalled viewers, each of which requests a stream and never reads."""
    with contextlib.ExitStack() as stack:
        viewers = []
        for path in paths:
            viewer = stack.enter_context(socket.socket())
            viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            viewer.connect(("127.0.0.1", port))
            viewer.sendall(f"GET {path} HTTP/1.1\r\nHost: here\r\n\r\n".encode())
            viewers.append(viewer)
        yield viewers


def describe_stalled(report: Report, found: StallComparison) -> None:
    """Print the rounds, and their medians."""
    rows = [
        [str(number), *(_cell(column, without, with_) for column in _COLUMNS)]
        for number, (without, with_) in enumerate(
            zip(found.without_stalled, found.with_stalled, strict=True), 1
        )
    ]
    report.table(
        f"{found.readers} viewers without / with {found.stalled} stalled ones: ms until a GOP has arrived",
        ["round", "p50", "p99", "arrived", "cores of the service"],
        rows,
    )
    report.line(f"p99 with stalled viewers / without: {found.ratio:.2f} (medians over rounds)")
    without, with_ = (
        statistics.median(reading_round.cores for reading_round in rounds)
        for rounds in (found.without_stalled, found.with_stalled)
    )
    report.line(f"cores of the service: {with_:.3f} with, {without:.3f} without (medians over rounds)")


_COLUMNS = {"p50": 1, "p99": 1, "arrived": 3, "cores": 2}
"""Columns with their number of digits."""


def _cell(name: str, without: ReadingRound, with_: ReadingRound) -> str:
    digits = _COLUMNS[name]
    return f"{getattr(without, name):.{digits}f} / {getattr(with_, name):.{digits}f}"
