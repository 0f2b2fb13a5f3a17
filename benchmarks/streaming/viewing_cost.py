"""Cost of viewers for the real best-view process: many objects, many viewers, time to the first picture."""

from __future__ import annotations

import io
import os
import socket
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass

import av
import numpy as np
from numpy.typing import NDArray

from benchmarks.streaming.simulated_cameras import GOP, SITE
from benchmarks.streaming.splice_cost import transcode
from benchmarks.streaming.stream_site import StreamSite, ViewerProcess
from benchmarks.streaming.timed_service import SendTimes
from benchmarks.streaming.viewer_crowd import CrowdReading
from server.camera.encoder import AccessUnit
from server.media.rendering_messages import TIMESCALE

_SETTLE_S = 2.0
_PAUSE_S = 0.037
"""Seconds between requests, chosen so that they fall on all phases of a GOP."""
_ENCODED_GOPS = 20
_RECEIVED = 65_536


@dataclass(frozen=True, slots=True)
class WatchingCost:
    """Cores of the best-view process by number of watched objects; medians over rounds."""

    objects: int
    unwatched: float
    one: float
    all: float
    encoded: float
    """Computed cores of one encoder per object."""
    rounds: int

    @property
    def ratio(self) -> float:
        """Cores with all objects watched divided by those with one."""
        return self.all / self.one

    @property
    def encoding_ratio(self) -> float:
        """Computed cores with an encoder per object, divided by the measured cores."""
        return (self.unwatched + self.encoded) / self.all


def watch_objects(
    site: StreamSite,
    viewers: ViewerProcess,
    numbers: Sequence[int],
    film: Sequence[AccessUnit],
    seconds: float,
    rounds: int,
) -> WatchingCost:
    """Measure with no, one and all objects watched, one viewer each, and re-encoding.

    The measurements alternate, so that other load on the machine affects all of them equally.
    """
    cores: dict[int, list[float]] = {0: [], 1: [], len(numbers): []}
    encoder_cores = []
    for _ in range(rounds):
        encoder_cores.append(SITE.fps * transcode(film, _ENCODED_GOPS).total / 1e6)
        for count, found in cores.items():
            viewers.watch([_path(number) for number in numbers[:count]], _SETTLE_S)
            found.append(_measure_cores(site, viewers, seconds)[0])
    unwatched, one, all_watched = (statistics.median(found) for found in cores.values())
    encoded = len(numbers) * statistics.median(encoder_cores)
    return WatchingCost(len(numbers), unwatched, one, all_watched, encoded, rounds)


@dataclass(frozen=True, slots=True)
class ViewerStep:
    """The measurement of a number of viewers."""

    viewers: int
    cores: float
    """Cores of the best-view process, including its other work."""
    reader_cores: float
    """Cores of the reading process."""
    kbits: float
    """Bit rate of a viewer's stream, kbit/s."""
    arrived: float
    """Share of the sent GOPs that arrived."""
    delays: tuple[float, float, float]
    """Milliseconds from when a GOP was sent to when its end was read: p50, p95, p99."""
    sent_ms: float
    """Median milliseconds until the last viewer's socket has accepted a GOP."""
    load: float
    """Load average of the machine."""


def step_up(
    site: StreamSite, viewers: ViewerProcess, numbers: Sequence[int], counts: Sequence[int], seconds: float
) -> list[ViewerStep]:
    """Measure increasing numbers of viewers, spread over the objects."""
    steps = []
    for count in counts:
        viewers.watch([_path(numbers[place % len(numbers)]) for place in range(count)], _SETTLE_S)
        cores, reading = _measure_cores(site, viewers, seconds)
        sent = site.sent
        delays = send_delays(reading, {first: sent_gop.began for first, sent_gop in sent.items()})
        p50, p95, p99 = np.percentile(delays, [50, 95, 99]).tolist()
        steps.append(
            ViewerStep(
                viewers=count,
                cores=cores,
                reader_cores=reading.processor_s / reading.seconds,
                kbits=8e3 * reading.megabytes / reading.seconds / count,
                arrived=len(delays) / (count * reading.seconds * SITE.fps / GOP),
                delays=(p50, p95, p99),
                sent_ms=statistics.median(_send_durations(reading, sent)),
                load=os.getloadavg()[0],
            )
        )
    return steps


def _send_durations(reading: CrowdReading, sent: dict[int, SendTimes]) -> list[float]:
    """Return the milliseconds that sending each received GOP took."""
    gops = {round(tick * SITE.fps / TIMESCALE) // GOP * GOP for tick in reading.ticks}
    return [1e3 * (sent_gop.ended - sent_gop.began) for first, sent_gop in sent.items() if first in gops]


def send_delays(reading: CrowdReading, sent: dict[int, float]) -> NDArray[np.float64]:
    """Return the milliseconds from when each GOP was sent to when its end was read."""
    gop = GOP
    last_pulses = (round(tick * SITE.fps / TIMESCALE) for tick in reading.ticks)
    return np.array(
        [
            1e3 * (arrival - sent[pulse - gop + 1])
            for pulse, arrival in zip(last_pulses, reading.arrivals, strict=True)
            if pulse % gop == gop - 1 and pulse - gop + 1 in sent
        ]
    )


def first_pictures(site: StreamSite, numbers: Sequence[int], count: int) -> NDArray[np.float64]:
    """Return the milliseconds from requesting a stream to its first decoded picture, for each request."""
    return np.array([_first_picture(site.http, numbers[place % len(numbers)]) for place in range(count)])


def _first_picture(port: int, number: int) -> float:
    time.sleep(_PAUSE_S)
    data, began = b"", time.perf_counter()
    with socket.create_connection(("127.0.0.1", port)) as viewer:
        viewer.sendall(f"GET {_path(number)} HTTP/1.0\r\n\r\n".encode())
        while not (end := end_of_first_fragment(data.partition(b"\r\n\r\n")[2])):
            received = viewer.recv(_RECEIVED)
            if not received:
                raise RuntimeError(f"the stream of object {number} ended before its first picture")
            data += received
    film = data.partition(b"\r\n\r\n")[2][:end]
    with av.open(io.BytesIO(film), "r") as container:
        next(container.decode(video=0))
    return 1e3 * (time.perf_counter() - began)


def end_of_first_fragment(data: bytes) -> int:
    """Return the end of the first `mdat` box; 0 if it is incomplete."""
    at = 0
    while at + 8 <= len(data):
        size, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        at += size
        if kind == b"mdat":
            return at if at <= len(data) else 0
    return 0


def _measure_cores(site: StreamSite, viewers: ViewerProcess, seconds: float) -> tuple[float, CrowdReading]:
    before = site.processor_seconds
    reading = viewers.read(seconds)
    return (site.processor_seconds - before) / reading.seconds, reading


def _path(number: int) -> str:
    return f"/objects/{number}/best.mp4"
