"""Scaling: cost of the best-view process per frame, by stage, and its growth with cameras; a plot.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.scaling --out out/bench

People are simulated, and so are the cameras' trackers and pictures (one small GOP in a loop). The bus, the
pulses and the best-view process are real; the process is timed from inside. Large sites get slower pulses, so
that the cost of a frame does not include queueing: "cores at 25" is the cost of 25 frames a second. Above one
the process does not keep up, since it decides in one thread.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.scaling.message_sizes import track_message_size
from benchmarks.scaling.simulated_hall import SimulatedHall
from benchmarks.scaling.simulated_site import SiteLoad, measure_load
from benchmarks.scaling.timed_service import REST, STAGES

_FPS = 25.0
_CAMERAS = (4, 16, 36, 64, 100)
_QUICK_CAMERAS = (4, 16)
_EASY = 16
"""Cameras up to which pulses have the full rate; larger sites get slower ones."""
_GROWTH = 1.5
"""Exponent of the number of cameras by which pulses become slower: slightly above that of the cost."""
_SETTLE, _EPOCHS = 16, 20
_QUICK_SETTLE, _QUICK_EPOCHS = 12, 8
_ABOUT_REST = "zenoh's threads and router, copies off the bus, the event loop"


def exponent(cameras: Sequence[int], values: Sequence[float]) -> float:
    """Fit ``values ~ cameras^k`` by least squares of logarithms; return k, NaN for fewer than two sizes."""
    if len(cameras) < 2:
        return float("nan")
    return float(np.polyfit(np.log(cameras), np.log(values), 1)[0])


def describe(report: Report, loads: Sequence[SiteLoad]) -> None:
    """Print the tables."""
    report.table(
        f"{_services(loads)}; processor time and memory",
        [
            "cameras",
            "people",
            "pulses/s",
            "ms a frame",
            "cores at 25",
            "msgs/s",
            "MB/s",
            "MB held",
            "lag, ms",
            "late",
            "",
        ],
        [
            [
                f"{load.cameras}",
                f"{load.people}",
                f"{load.fps:g}",
                f"{load.milliseconds:.1f}",
                f"{load.milliseconds * _FPS / 1e3:.2f}",
                f"{load.messages:.0f}",
                f"{load.megabytes:.1f}",
                f"{load.memory:.0f}",
                f"≤ {1e3 * load.lag:g}",
                f"{load.late}",
                f"of {load.epochs * load.cameras * load.services} windows",
            ]
            for load in loads
        ],
    )
    names = {**STAGES, REST: _ABOUT_REST}
    cameras = [load.cameras for load in loads]
    rows = [
        [
            stage,
            *(f"{load.stages[stage]:.2f}" for load in loads),
            f"{exponent(cameras, [max(load.stages[stage], 1e-6) for load in loads]):.2f}",
            about,
        ]
        for stage, about in names.items()
    ]
    total = [load.milliseconds for load in loads]
    rows.append(["total", *(f"{value:.1f}" for value in total), f"{exponent(cameras, total):.2f}", ""])
    report.table(
        "processor ms a frame, by cameras, and the exponent of growth",
        ["stage", *(f"{camera}" for camera in cameras), "grows", "what"],
        rows,
    )
    report.line(
        "messages and bytes: at 25 pulses a second; late: windows decided without their camera; "
        "lag: of the event loop, in 95 % of the time"
    )
    size = track_message_size(SimulatedHall(loads[0].cameras, loads[0].per_camera))
    report.line(
        f"tracks of a camera with {loads[0].per_camera} people: {size.packed:.0f} kB a second"
        f" (as JSON with all digits: {size.json:.0f})"
    )


def _services(loads: Sequence[SiteLoad]) -> str:
    count = loads[0].services
    return "One best-view process" if count == 1 else f"Each of {count} best-view processes of the site"


def plot(loads: Sequence[SiteLoad], path: Path) -> None:
    """Draw the cost of a frame over the number of cameras, by stage."""
    from matplotlib.figure import Figure  # noqa: PLC0415 — only after what is measured

    figure = Figure(figsize=(9, 5), layout="constrained")
    axis = figure.subplots()
    cameras = [load.cameras for load in loads]
    for stage in (*STAGES, REST):
        axis.plot(cameras, [load.stages[stage] for load in loads], marker=".", label=stage)
    axis.plot(cameras, [load.milliseconds for load in loads], marker="o", color="black", label="together")
    axis.axhline(1e3 / _FPS, color="black", linestyle="--", linewidth=1, label="one core at 25 a second")
    axis.set(xscale="log", yscale="log", xlabel="cameras", ylabel="processor ms a frame")
    axis.set_title(f"{_services(loads)}, about {loads[0].per_camera} people in each camera's view")
    axis.set_xticks(cameras, [f"{camera}" for camera in cameras])
    axis.legend(ncols=2, fontsize="small")
    figure.savefig(path, dpi=110)


def measure(options: argparse.Namespace) -> None:
    """Run every size, print and save."""
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    quick = options.quick
    sizes = options.cameras or (_QUICK_CAMERAS if quick else _CAMERAS)
    loads = []
    with tempfile.TemporaryDirectory(prefix="myview-scaling-") as temporary:
        for cameras in sizes:
            fps = options.fps or max(1.0, round(_FPS * min(1.0, (_EASY / cameras) ** _GROWTH)))
            hall = SimulatedHall(cameras, options.people)
            settle, epochs = (_QUICK_SETTLE, _QUICK_EPOCHS) if quick else (_SETTLE, _EPOCHS)
            loads.append(
                measure_load(hall, fps, Path(temporary) / f"{cameras}", settle, epochs, options.services)
            )
            report.line(f"{cameras} cameras: {loads[-1].milliseconds:.1f} ms a frame")
    describe(report, loads)
    plot(loads, options.out / "scaling.png")
    report.save(options.out / "scaling.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "scaling")
    options.add_argument("--quick", action="store_true", help="two small sites, briefly")
    options.add_argument("--cameras", type=int, action="append", help="only this number; may be repeated")
    options.add_argument("--people", type=int, default=30, help="in each camera's view, on average")
    options.add_argument("--services", type=int, default=1, help="best-view services that divide the site")
    options.add_argument("--fps", type=float, help="pulses a second; without it, fewer for large sites")
    measure(options.parse_args())


if __name__ == "__main__":
    main()
