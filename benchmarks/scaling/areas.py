"""Areas: what best-view services need that divide a site by area, beside one that has all of it.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.scaling.areas --out out/bench

A simulated hall, as in `benchmarks.scaling`. Measured is who is who: the filter of an area, identity across
cameras, and the agreement about numbers; not video, quality and decisions, which are divided with the people.
*Equal* is the share of tracks at the end that have the same person as without areas, whatever the numbers.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.scaling.divided_hall import DividedRun, agreement, observe, run_divided
from benchmarks.scaling.simulated_hall import FPS, SimulatedHall
from server.supervisor.bestview_process import collect_garbage_rarely

_CAMERAS, _SERVICES = (8, 36, 100), (1, 2, 4, 8)
_QUICK_CAMERAS, _QUICK_SERVICES = (8, 16), (1, 2)


def rows_of(hall: SimulatedHall, runs: dict[int, DividedRun]) -> list[list[str]]:
    """Return the table's rows of a hall, from the runs by their number of services, one of them 1."""
    whole = runs[1]
    return [
        [
            f"{hall.cameras}",
            f"{hall.people}",
            f"{services}",
            f"{max(run.cameras)}",
            f"{run.busiest_ms:.1f}",
            f"{run.busiest_ms * FPS / 1e3:.2f}",
            f"{run.sum_ms:.1f}",
            f"{run.record_kb / services:.0f}",
            f"{100 * agreement(whole.numbers[-1], run.numbers[-1]):.1f}",
            f"{run.changes}",
            f"{run.doubled}",
        ]
        for services, run in runs.items()
    ]


def plot(times: dict[int, dict[int, DividedRun]], path: Path) -> None:
    """Draw the time of the busiest service over the number of services."""
    from matplotlib.figure import Figure  # noqa: PLC0415 — only after what is measured

    figure = Figure(figsize=(7, 4), layout="constrained")
    axis = figure.subplots()
    for cameras, runs in times.items():
        axis.plot(
            list(runs), [run.busiest_ms for run in runs.values()], marker="o", label=f"{cameras} cameras"
        )
    axis.axhline(1e3 / FPS, color="black", linestyle="--", linewidth=1, label="one core at 25 a second")
    services = sorted({services for runs in times.values() for services in runs})
    axis.set(xscale="log", yscale="log", xlabel="services", ylabel="processor ms a frame, the busiest")
    axis.set_xticks(services, [f"{each}" for each in services])
    axis.minorticks_off()
    axis.set_title("Identity of a site that is divided by area")
    axis.legend(fontsize="small")
    figure.savefig(path, dpi=110)


def measure(options: argparse.Namespace) -> None:
    """Run every size, print and save."""
    options.out.mkdir(parents=True, exist_ok=True)
    collect_garbage_rarely()
    report = Report()
    sizes = options.cameras or (_QUICK_CAMERAS if options.quick else _CAMERAS)
    counts = _QUICK_SERVICES if options.quick else _SERVICES
    times: dict[int, dict[int, DividedRun]] = {}
    rows = []
    for cameras in sizes:
        hall = SimulatedHall(cameras, options.people)
        observed = observe(hall, options.epochs)
        times[cameras] = {
            services: run_divided(hall, observed, services) for services in counts if services <= cameras
        }
        rows += rows_of(hall, times[cameras])
        report.line(f"{cameras} cameras: {times[cameras][1].sum_ms:.1f} ms a frame without areas")
    columns = [
        "cameras",
        "people",
        "services",
        "taken in",
        "busiest",
        "cores at 25",
        "sum, ms",
        "kB/s sent",
        "equal, %",
        "changes",
        "doubled",
    ]
    report.table("who is who, by services; processor ms a frame", columns, rows)
    last = times[max(times)]
    if len(last) > 1:
        grows = np.polyfit(np.log(list(last)), np.log([run.busiest_ms for run in last.values()]), 1)[0]
        report.line(f"{max(times)} cameras: the busiest needs services^{grows:.2f}")
    report.line("changes of people's numbers, and people with two numbers at once, over all epochs")
    plot(times, options.out / "areas.png")
    report.save(options.out / "areas.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "scaling.areas")
    options.add_argument("--quick", action="store_true", help="small halls, one and two services")
    options.add_argument("--cameras", type=int, action="append", help="only this number; may be repeated")
    options.add_argument("--people", type=int, default=30, help="in each camera's view, on average")
    options.add_argument("--epochs", type=int, default=40, help="of five frames")
    measure(options.parse_args())


if __name__ == "__main__":
    main()
