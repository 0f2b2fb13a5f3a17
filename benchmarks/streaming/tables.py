"""The tables and the plot of the streaming benchmark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.common.report import Report
from benchmarks.streaming.bare_sockets import BareSocketCost
from benchmarks.streaming.delay_drift import DelayDrift
from benchmarks.streaming.ffmpeg_and_nginx import HlsServingCost
from benchmarks.streaming.frame_correctness import FrameCorrectness
from benchmarks.streaming.hls_latency import HlsLatency
from benchmarks.streaming.simulated_cameras import SITE
from benchmarks.streaming.splice_cost import SpliceCost, TranscodeCost
from benchmarks.streaming.viewing_cost import ViewerStep, WatchingCost

_FRAME_MS = 40.0
"""A frame's duration."""
_MIN_ARRIVED = 0.9
"""Share of received GOPs below which the cost per viewer is underestimated."""


@dataclass
class StreamMeasurements:
    """All measurements of the benchmark."""

    transcoded: TranscodeCost | None = None
    spliced: list[SpliceCost] = field(default_factory=list)
    ffmpeg: float | None = None
    """Microseconds per frame."""
    watched: WatchingCost | None = None
    steps: list[ViewerStep] = field(default_factory=list)
    bare: BareSocketCost | None = None
    beyond_file_limit: list[int] = field(default_factory=list)
    """Numbers of viewers beyond the limit of open files."""
    service_hls: HlsServingCost | None = None
    nginx_hls: HlsServingCost | None = None
    first_pictures_ms: NDArray[np.float64] | None = None
    """`(requests,)`."""
    correctness: FrameCorrectness | None = None
    drift: DelayDrift | None = None
    hls_latency: tuple[HlsLatency, HlsLatency] | None = None
    """Of whole segments, and of parts."""


def describe(report: Report, found: StreamMeasurements) -> None:
    """Print the tables."""
    if found.spliced and found.transcoded:
        _splices(report, found, found.transcoded)
    if found.steps:
        _steps(report, found)
    rows = summary(found)
    if rows:
        report.table("Streaming", ["quantity", "measured", "target", "how"], rows)


def _splices(report: Report, found: StreamMeasurements, transcoded: TranscodeCost) -> None:
    rows = [
        [
            f"spliced, objects: {cost.objects}",
            f"{cost.spliced:.2f}",
            f"{transcoded.total / cost.spliced:.0f}",
            f"{transcoded.total / (cost.spliced + cost.buffered_share):.0f}",
            "with one viewer each",
        ]
        for cost in found.spliced
    ]
    rows.append(["decoded", f"{transcoded.decoded:.0f}", "", "", "one thread"])
    rows.append(["re-encoded", f"{transcoded.encoded:.0f}", "1", "1", "the site's encoder, from BGR"])
    if found.ffmpeg is None:
        report.line("ffmpeg: skipped: needs ffmpeg; on Debian: apt install ffmpeg")
    else:
        rows.append(["ffmpeg", f"{found.ffmpeg:.0f}", "", "", "switches between four cameras, and encodes"])
    columns = ["", "µs/frame", "times cheaper", "with buffering", "how"]
    report.table("Processor time per object and frame, compared with decoding and encoding", columns, rows)


def _steps(report: Report, found: StreamMeasurements) -> None:
    rows = [
        [
            f"{step.viewers}",
            f"{step.cores:.2f}",
            f"{step.reader_cores:.2f}",
            f"{step.kbits:.0f}",
            f"{100 * step.arrived:.0f} %",
            f"{step.sent_ms:.0f}",
            *(f"{value:.0f}" for value in step.delays),
            f"{step.load:.1f}",
        ]
        for step in found.steps
    ]
    columns = ["viewers", "cores", "readers' cores", "kbit/s each", "arrived"]
    columns += ["sent ms", "p50 ms", "p95 ms", "p99 ms", "load"]
    report.table("Viewers of 50 objects: ms from when a GOP is sent to when its end is read", columns, rows)
    if found.bare:
        report.line(_bare(found.bare))
    for count in found.beyond_file_limit:
        report.line(f"{count} viewers: skipped: beyond the limit of open files (ulimit -Hn)")
    if found.service_hls:
        report.line(f"HLS of the service: {_served(found.service_hls)}")
    if found.nginx_hls:
        report.line(f"HLS of nginx, same files: {_served(found.nginx_hls)}")
    else:
        report.line("HLS of nginx: skipped: needs nginx; on Debian: apt install nginx-light")


def _bare(cost: BareSocketCost) -> str:
    delays = ", ".join(f"{value:.0f}" for value in cost.delays)
    return (
        f"For comparison, a bare loop over {cost.viewers} sockets: "
        f"{cost.microseconds:.1f} µs of the processor each, sent in {cost.sent_ms:.0f} ms; "
        f"read after {delays} ms (p50, p95, p99)"
    )


def _served(served: HlsServingCost) -> str:
    return (
        f"{served.microseconds:.0f} µs for a playlist and a segment of {served.kilobytes:.0f} kB, "
        f"which is {served.per_core:.0f} viewers per core at a segment per second"
    )


def summary(found: StreamMeasurements) -> list[list[str]]:
    """Return the rows of the summary table."""
    rows = []
    if found.spliced and found.transcoded:
        last = found.spliced[-1]
        ratio = found.transcoded.total / last.spliced
        rows.append(
            [
                "re-encoding / splice",
                f"{ratio:.0f}x",
                "1000x",
                f"per object and frame; {last.objects} objects",
            ]
        )
    if found.watched:
        rows += _watched_rows(found.watched)
    if found.steps:
        rows += _viewer_rows(found)
    if found.first_pictures_ms is not None:
        p50, p95 = np.percentile(found.first_pictures_ms, [50, 95])
        how = f"decoded, of {len(found.first_pictures_ms)} requests; p50 {p50:.1f} ms"
        rows.append(["request to first picture, p95", f"{p95:.1f} ms", "100 ms", how])
    if found.correctness:
        rows.append(_correctness_row(found.correctness))
    if found.drift:
        rows += _drift_rows(found.drift)
    if found.hls_latency:
        rows += _hls_rows(*found.hls_latency)
    return rows


def _correctness_row(found: FrameCorrectness) -> list[str]:
    correct = found.in_file if found.in_ts is None else min(found.in_file, found.in_ts)
    containers = "WebM" if found.in_ts is None else "MP4 and transport stream"
    how = f"{found.cuts} cuts; {containers}, pixel by pixel"
    return ["frames of the selected camera", f"{correct} of {found.frames}", "all", how]


def _hls_rows(segments: HlsLatency, parts: HlsLatency) -> list[list[str]]:
    return [
        [
            f"HLS, {played}: decided to shown, p50",
            f"{latency.shown:.1f} s",
            "",
            f"fetched after {latency.fetched:.2f} s; {latency.stalls} stalls",
        ]
        for played, latency in (("whole segments", segments), ("parts", parts))
    ]


def _watched_rows(watched: WatchingCost) -> list[list[str]]:
    how = (
        f"cores: {watched.all:.3f}, {watched.one:.3f}, none {watched.unwatched:.3f}; {watched.rounds} rounds"
    )
    rows = [[f"watching {watched.objects} objects, relative to 1", f"{watched.ratio:.2f}x", "1.10x", how]]
    how = f"computed: {watched.unwatched + watched.encoded:.2f} cores with an encoder per object"
    rows.append(["re-encoding each, relative to that", f"{watched.encoding_ratio:.1f}x", "14x", how])
    return rows


def per_core(steps: Sequence[ViewerStep]) -> tuple[float, float]:
    """Fit a line to the cores; return the cores without viewers, and the number of viewers per core."""
    slope, idle = np.polyfit([step.viewers for step in steps], [step.cores for step in steps], 1)
    return float(idle), float((1.0 - idle) / slope)


def _viewer_rows(found: StreamMeasurements) -> list[list[str]]:
    in_time = max((step.viewers for step in found.steps if step.delays[2] < _FRAME_MS), default=0)
    rows = [
        [
            "viewers with p99 below 40 ms",
            f"{in_time}",
            "4000",
            "of the measured counts; all receive each GOP at the same time",
        ]
    ]
    complete = [step for step in found.steps if step.arrived > _MIN_ARRIVED]
    if len(complete) > 1:
        idle, count = per_core(complete)
        how = f"by processor time beyond {idle:.2f} idle cores; linear fit up to {complete[-1].viewers}"
        rows.insert(0, ["viewers per core", f"{count:.0f}", "4000", how])
    return rows


def _drift_rows(found: DelayDrift) -> list[list[str]]:
    minutes = found.pulses / SITE.fps / 60
    return [
        [
            f"delay in {minutes:.0f} minutes",
            f"{found.min_delay} to {found.max_delay} pulses",
            "no drift",
            f"{found.gops} GOPs; largest time error {found.max_time_error} ticks of 1/90000 s",
        ],
        [
            "cost per pulse, last tenth",
            f"{found.costs[-1] / found.costs[0]:.2f}x",
            "no drift",
            f"of the first tenth's {found.costs[0]:.2f} ms",
        ],
    ]


def plot(found: StreamMeasurements, path: Path) -> None:
    """Draw the cost and the delay of viewers."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    viewers = [step.viewers for step in found.steps]
    left.plot(viewers, [step.cores for step in found.steps], marker="o")
    left.set(xlabel="viewers", ylabel="cores of the best-view process", xlim=(0, None), ylim=(0, None))
    for index, name in enumerate(("p50", "p95", "p99")):
        right.plot(viewers, [step.delays[index] for step in found.steps], marker="o", label=name)
    right.axhline(_FRAME_MS, color="black", linestyle="--", linewidth=1, label="40 ms")
    right.set(xlabel="viewers", ylabel="ms until a GOP has arrived", xlim=(0, None), ylim=(0, None))
    right.legend()
    figure.savefig(path, dpi=110)
