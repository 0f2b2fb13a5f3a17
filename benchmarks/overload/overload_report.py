"""The table and the plot of a site to which cameras are added."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.report import Report
from benchmarks.overload.growing_site import FPS
from benchmarks.overload.samples import RECOVERED_S, OverloadResult


def describe(report: Report, found: OverloadResult) -> None:
    """Print the table."""
    report.table(
        f"cameras of 352x288 at {FPS:g} a second: what is left out, and what a viewer of a person sees",
        [
            "cameras",
            "level, median",
            "most",
            "searched",
            "missed",
            "windows late",
            "delay p50, ms",
            "p95",
            "holes",
        ],
        [
            [
                *(str(it.cameras), f"{it.levels[0]:g}", str(it.levels[1])),
                *(f"{100 * share:.1f} %" for share in (it.searched, it.missed, it.late)),
                *(f"{delay:.0f}" for delay in it.delays),
                str(it.holes),
            ]
            for it in found.steps
        ],
    )
    report.say(f"carried without leaving anything out: {found.carried}")
    back = f"longer than {RECOVERED_S:.0f} s" if found.back is None else f"{found.back:.0f} s"
    report.say(f"all but one killed: nothing is left out any more after {back}")


def plot(found: OverloadResult, path: Path) -> None:
    """Draw levels and delay over time."""
    figure = Figure(figsize=(9, 6))
    levels, delay = figure.subplots(2, 1, sharex=True)
    times = [it.at for it in found.samples]
    levels.step(
        *zip(*found.started, (times[-1], 1), strict=True), where="post", label="cameras", color="grey"
    )
    means = [float(np.mean(it.levels)) if it.levels else 0.0 for it in found.samples]
    levels.plot(times, means, label="level, mean of the cameras")
    levels.plot(
        times, [max(it.levels, default=0) for it in found.samples], label="the highest", linewidth=0.7
    )
    levels.set(ylabel="cameras; level of the ladder", ylim=(0, None))
    levels.legend(fontsize="small")
    middles = [float(np.median(it.delays)) if it.delays else np.nan for it in found.samples]
    delay.plot(times, middles, marker=".", linewidth=0.7)
    delay.set(ylabel="delay of a person's view, ms", xlabel="seconds", ylim=(0, None))
    for axis in (levels, delay):
        axis.grid(alpha=0.3)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
