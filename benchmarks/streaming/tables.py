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

_SOON_MS = 40.0
"""A frame's duration."""
_WHOLE = 0.9
"""Share of received GOPs below which viewers appear too cheap."""


@dataclass
class StreamMeasurements:
    """All measurements of the benchmark."""

    encoded: TranscodeCost | None = None
    spliced: list[SpliceCost] = field(default_factory=list)
    ffmpeg: float | None = None
    """Microseconds a frame."""
    watched: WatchingCost | None = None
    steps: list[ViewerStep] = field(default_factory=list)
    bare: BareSocketCost | None = None
    too_many: list[int] = field(default_factory=list)
    """Numbers of viewers beyond the limit of open files."""
    here: HlsServingCost | None = None
    nginx: HlsServingCost | None = None
    first: NDArray[np.float64] | None = None
    """(requests,) milliseconds."""
    right: FrameCorrectness | None = None
    drift: DelayDrift | None = None
    hls: tuple[HlsLatency, HlsLatency] | None = None
    """Without parts, and with them."""


def describe(report: Report, found: StreamMeasurements) -> None:
    """Print the tables."""
    if found.spliced and found.encoded:
        _splices(report, found, found.encoded)
    if found.steps:
        _steps(report, found)
    rows = summary(found)
    if rows:
        report.table("Streaming", ["quantity", "measured", "target", "how"], rows)


def _splices(report: Report, found: StreamMeasurements, encoded: TranscodeCost) -> None:
    rows = [
        [
            f"spliced, objects: {cost.objects}",
            f"{cost.spliced:.2f}",
            f"{encoded.whole / cost.spliced:.0f}",
            f"{encoded.whole / (cost.spliced + cost.shelved_share):.0f}",
            "with one viewer each",
        ]
        for cost in found.spliced
    ]
    rows.append(["decoded", f"{encoded.decoded:.0f}", "", "", "one thread"])
    rows.append(["encoded again", f"{encoded.encoded:.0f}", "1", "1", "the site's encoder, from BGR"])
    if found.ffmpeg is None:
        report.line("ffmpeg: skipped: needs ffmpeg; on Debian: apt install ffmpeg")
    else:
        rows.append(["ffmpeg", f"{found.ffmpeg:.0f}", "", "", "switches all four cameras, and encodes"])
    columns = ["", "µs a frame", "times cheaper", "with buffering", "how"]
    report.table("Processor time per object and frame, compared with decoding and encoding", columns, rows)


def _steps(report: Report, found: StreamMeasurements) -> None:
    rows = [
        [
            f"{step.viewers}",
            f"{step.cores:.2f}",
            f"{step.crowd:.2f}",
            f"{step.kbits:.0f}",
            f"{100 * step.arrived:.0f} %",
            f"{step.given:.0f}",
            *(f"{value:.0f}" for value in step.delays),
            f"{step.load:.1f}",
        ]
        for step in found.steps
    ]
    columns = ["viewers", "cores", "reader's", "kbit/s each", "arrived"]
    columns += ["sent ms", "p50 ms", "p95 ms", "p99 ms", "load"]
    report.table("Viewers of 50 objects: ms from when a GOP is sent to when its end is read", columns, rows)
    if found.bare:
        report.line(_bare(found.bare))
    for count in found.too_many:
        report.line(f"{count} viewers: skipped: a process may not open so many files (ulimit -Hn)")
    if found.here:
        report.line(f"HLS here: {_served(found.here)}")
    if found.nginx:
        report.line(f"HLS of nginx, the same files: {_served(found.nginx)}")
    else:
        report.line("HLS of nginx: skipped: needs nginx; on Debian: apt install nginx-light")


def _bare(cost: BareSocketCost) -> str:
    late = ", ".join(f"{value:.0f}" for value in cost.delays)
    return (
        f"A bare loop of sends to {cost.viewers} sockets, beside it: {cost.each:.1f} µs of the processor each, "
        f"sent in {cost.given:.0f} ms; read after {late} ms (p50, p95, p99)"
    )


def _served(served: HlsServingCost) -> str:
    return (
        f"{served.microseconds:.0f} µs for a playlist and a segment of {served.kilobytes:.0f} kB, "
        f"which is {served.per_core:.0f} viewers of a segment a second per core"
    )


def summary(found: StreamMeasurements) -> list[list[str]]:
    """Return the rows of the summary table."""
    rows = []
    if found.spliced and found.encoded:
        last = found.spliced[-1]
        ratio = found.encoded.whole / last.spliced
        rows.append(
            [
                "splice against re-encoding",
                f"{ratio:.0f}x",
                "1000x",
                f"an object and a frame; {last.objects} objects",
            ]
        )
    if found.watched:
        rows += _watched_rows(found.watched)
    if found.steps:
        rows += _viewer_rows(found)
    if found.first is not None:
        middle, late = np.percentile(found.first, [50, 95])
        what = f"of {len(found.first)} requests; p50 {middle:.1f} ms"
        rows.append(["request to first picture, p95", f"{late:.1f} ms", "100 ms", f"decoded, {what}"])
    if found.right:
        correctness = found.right
        good = correctness.contained if correctness.ts is None else min(correctness.contained, correctness.ts)
        how = f"{correctness.cuts} cuts; {'WebM' if correctness.ts is None else 'MP4 and transport stream'}, to the pixel"
        rows.append(["right camera on every frame", f"{good} of {correctness.frames}", "all", how])
    if found.drift:
        rows += _drift_rows(found.drift)
    if found.hls:
        rows += _hls_rows(*found.hls)
    return rows


def _hls_rows(segments: HlsLatency, parts: HlsLatency) -> list[list[str]]:
    return [
        [
            f"HLS, {what}: decided to shown, p50",
            f"{serving_cost.shown:.1f} s",
            "",
            f"fetched after {serving_cost.fetched:.2f} s; {serving_cost.stalls} stalls",
        ]
        for what, serving_cost in (("whole segments", segments), ("parts", parts))
    ]


def _watched_rows(watched: WatchingCost) -> list[list[str]]:
    how = (
        f"cores: {watched.all:.3f}, {watched.one:.3f}, none {watched.unwatched:.3f}; {watched.rounds} rounds"
    )
    rows = [[f"watching {watched.objects} objects against 1", f"{watched.ratio:.2f}x", "1.10x", how]]
    how = f"computed: {watched.unwatched + watched.encoded:.2f} cores with an encoder for each"
    rows.append(["re-encoding each against that", f"{watched.against_encoding:.1f}x", "14x", how])
    return rows


def per_core(steps: Sequence[ViewerStep]) -> tuple[float, float]:
    """Fit a line to the cores; return the cores without viewers, and the viewers that fill a core."""
    slope, alone = np.polyfit([step.viewers for step in steps], [step.cores for step in steps], 1)
    return float(alone), float((1.0 - alone) / slope)


def _viewer_rows(found: StreamMeasurements) -> list[list[str]]:
    soon = max((step.viewers for step in found.steps if step.delays[2] < _SOON_MS), default=0)
    rows = [
        [
            "viewers with p99 below 40 ms",
            f"{soon}",
            "4000",
            "of the tried counts; all receive each GOP at once",
        ]
    ]
    whole = [step for step in found.steps if step.arrived > _WHOLE]
    if len(whole) > 1:
        alone, count = per_core(whole)
        how = (
            f"by processor time, beside the service's own {alone:.2f} cores; a line up to {whole[-1].viewers}"
        )
        rows.insert(0, ["viewers that fill a core", f"{count:.0f}", "4000", how])
    return rows


def _drift_rows(cost: DelayDrift) -> list[list[str]]:
    minutes = cost.pulses / SITE.fps / 60
    return [
        [
            f"delay in {minutes:.0f} minutes",
            f"{cost.least} to {cost.most} pulses",
            "no drift",
            f"{cost.gops} GOPs; times off by {cost.off} ticks of 1/90000 s",
        ],
        [
            "cost of a pulse, last tenth",
            f"{cost.costs[-1] / cost.costs[0]:.2f}x",
            "no drift",
            f"of the first tenth's {cost.costs[0]:.2f} ms",
        ],
    ]


def plot(found: StreamMeasurements, path: Path) -> None:
    """Draw the cost and the delay of viewers."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    viewers = [step.viewers for step in found.steps]
    left.plot(viewers, [step.cores for step in found.steps], marker="o")
    left.set(xlabel="viewers", ylabel="cores of the best-view process", xlim=(0, None), ylim=(0, None))
    for place, name in enumerate(("p50", "p95", "p99")):
        right.plot(viewers, [step.delays[place] for step in found.steps], marker="o", label=name)
    right.axhline(_SOON_MS, color="black", linestyle="--", linewidth=1, label="40 ms")
    right.set(xlabel="viewers", ylabel="ms until a GOP has arrived", xlim=(0, None), ylim=(0, None))
    right.legend()
    figure.savefig(path, dpi=110)
