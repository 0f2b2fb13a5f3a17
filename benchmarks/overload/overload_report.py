"""The table and the plot of the overload benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.report import Report
from benchmarks.overload.growing_site import FPS
from benchmarks.overload.samples import RECOVERED_S, OverloadResult


def describe(report: Report, result: OverloadResult) -> None:
    """Print the table."""
    report.table(
        f"cameras of 352x288 at {FPS:g} a second: load shedding, and what a viewer of a person sees",
        [
            "cameras",
            "shed level, median",
            "max.",
            "searched",
            "missed",
            "windows late",
            "delay p50, ms",
            "p95",
            "holes",
        ],
        [
            [
                *(str(step.cameras), f"{step.levels[0]:g}", str(step.levels[1])),
                *(f"{100 * share:.1f} %" for share in (step.searched, step.missed, step.late)),
                *(f"{delay:.0f}" for delay in step.delays),
                str(step.missing_frames),
            ]
            for step in result.steps
        ],
    )
    report.line(f"cameras carried without load shedding: {result.cameras_carried}")
    recovery_s = (
        f"longer than {RECOVERED_S:.0f} s" if result.recovery_s is None else f"{result.recovery_s:.0f} s"
    )
    report.line(f"after killing all cameras but one: no load shedding after {recovery_s}")


def plot(result: OverloadResult, path: Path) -> None:
    """Draw levels and delay over time."""
    figure = Figure(figsize=(9, 6))
    levels, delay = figure.subplots(2, 1, sharex=True)
    times = [sample.at for sample in result.samples]
    levels.step(
        *zip(*result.started, (times[-1], 1), strict=True), where="post", label="cameras", color="gray"
    )
    means = [float(np.mean(sample.levels)) if sample.levels else 0.0 for sample in result.samples]
    levels.plot(times, means, label="shed level, mean of the cameras")
    levels.plot(
        times,
        [max(sample.levels, default=0) for sample in result.samples],
        label="highest shed level",
        linewidth=0.7,
    )
    levels.set(ylabel="cameras; shed level", ylim=(0, None))
    levels.legend(fontsize="small")
    middles = [float(np.median(sample.delays)) if sample.delays else np.nan for sample in result.samples]
    delay.plot(times, middles, marker=".", linewidth=0.7)
    delay.set(ylabel="delay of a person's view, ms", xlabel="seconds", ylim=(0, None))
    for axis in (levels, delay):
        axis.grid(alpha=0.3)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
