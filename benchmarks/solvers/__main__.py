"""Speed of the solvers of the tracking program: tables, and plots of the paper's Fig. 21 and Table I.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.solvers --out out/bench

Times are processor time of one thread, which excludes other work on the machine; every ratio is of times from
the same run.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.solvers.random_windows import WindowSize
from benchmarks.solvers.solver_times import (
    BUDGET_CASES,
    CASES,
    EXACT_CASES,
    GATE,
    WindowCase,
    against_arcs,
    live,
    timed,
    warm_up,
)
from benchmarks.solvers.time_growth import (
    LAYOUT_SWEEPS,
    SOLVERS,
    SWEEPS,
    SizeSweep,
    exponent_of_all,
    grown,
    plot_growth,
    plot_table1,
    table1,
)
from benchmarks.solvers.tracked_crowd import track_crowd
from tracking.solvers import SolverBudget

BUDGETS = (0.07, 0.25, 1.0)
"""Seconds of work; the first is that of a window of the live tracker."""

LIVE = (WindowSize(8, 16, 15), WindowSize(10, 40, 15), WindowSize(20, 40, 15), WindowSize(60, 60, 15))

CROWDS, CROWD_S = (WindowSize(20, 40), WindowSize(60, 60)), 4.0
"""Crowds that the live tracker tracks, and for how many seconds; a window is 15 frames."""


def named(case: WindowCase) -> list[str]:
    """Return the cells that name the case."""
    return [case.name, f"{case.size.objects}", f"{case.size.places}", f"{case.layout:g}"]


def ratios(case: WindowCase, seeds: int) -> list[str]:
    """Return a row: full and gated programs of all arcs against `columns`."""
    cells = named(case)
    for gate in (None, GATE):
        found = against_arcs(case, seeds, gate)
        cells += [f"{1e3 * found.arcs:.0f}", f"{1e3 * found.columns:.1f}", f"{found.ratio:.0f}x"]
    return cells


def exact(case: WindowCase, seeds: int) -> list[str]:
    """Return a row: the time of the integer optimum, and the gap of the rounded solution."""
    found = [
        (timed("exact", network), timed("columns", network).solution.report)
        for network in map(case.network, range(seeds))
    ]
    optima = [optimum.solution.report.objective for optimum, _ in found]
    off = [rounded.objective / best - 1.0 for best, (_, rounded) in zip(optima, found, strict=True)]
    below = [1.0 - rounded.bound / best for best, (_, rounded) in zip(optima, found, strict=True)]
    times = [1e3 * optimum.seconds for optimum, _ in found]
    shares = [
        f"{np.median(times):.0f}",
        f"{max(times):.0f}",
        f"{100 * max(off):.2f}",
        f"{100 * max(below):.2f}",
    ]
    return [*named(case), *shares]


def budget(case: WindowCase, work_s: float, seeds: int) -> list[str]:
    """Return a row: the time under a limit of work, how often it is reached, and the gaps."""
    found = [timed("columns", case.network(seed, GATE), SolverBudget(work_s)) for seed in range(seeds)]
    reports = [solved.solution.report for solved in found]
    times, gaps = [1e3 * solved.seconds for solved in found], [100 * report.gap for report in reports]
    stopped = sum(report.limit is not None for report in reports)
    shares = [f"{np.median(times):.0f}", f"{max(times):.0f}", f"{stopped} of {seeds}", f"{max(gaps):.2f}"]
    return [*named(case), f"{1e3 * work_s:.0f}", *shares]


def live_row(size: WindowSize, steps: int, *, warm: bool) -> list[str]:
    """Return a row: windows at stride 1, including building the network from boxes and histograms."""
    found = live(size, steps, warm=warm)
    middle, late = np.percentile(1e3 * found.seconds, [50, 95])
    return [
        "warm" if warm else "cold",
        f"{size.objects}",
        f"{size.places}",
        f"{size.frames}",
        f"{middle:.1f}",
        f"{late:.1f}",
        f"{1e3 * found.seconds.max():.1f}",
        f"{100 * (found.rounds == 0).mean():.0f}",
        f"{found.rounds.mean():.1f}",
    ]


def crowd_row(size: WindowSize, seconds: float, seed: int) -> list[str]:
    """Return a row: the windows of the live tracker, with everything that they do."""
    found = track_crowd(size, seconds, seed)
    times = [np.percentile(1e3 * found.windows, share) for share in (50, 95, 100)]
    return [
        f"{size.objects}",
        f"{size.places}",
        f"{found.objects.mean():.0f}",
        *(f"{value:.0f}" for value in times),
        f"{1e3 * np.percentile(found.solves, 95):.0f}",
        f"{100 * found.stopped.mean():.0f}",
        f"{100 * found.gaps.max():.2f}",
    ]


def growth_table(
    report: Report, sweeps: Sequence[SizeSweep], title: str, options: argparse.Namespace, plot: str
) -> None:
    """Print how times grow along the sweeps, and draw them."""
    growths = [grown(sweep, solver, options.seeds) for sweep in sweeps for solver in SOLVERS]
    rows = [
        [growth.sweep.label, growth.solver, f"{1e3 * growth.times[-1]:.0f}", f"{growth.exponent:.2f}"]
        for growth in growths
    ]
    rows += [["all of these", solver, "", f"{exponent_of_all(growths, solver):.2f}"] for solver in SOLVERS]
    report.table(
        f"{title}: time ~ (n² k m (2 log k + 2 log n + log m))^e; up to 1 is no worse than the paper's; ms",
        ["along", "solver", "largest", "e"],
        rows,
    )
    plot_growth(growths, title, options.out / plot)


def run(options: argparse.Namespace) -> None:
    """Print the tables and draw the plots."""
    report = Report()
    options.out.mkdir(parents=True, exist_ok=True)
    warm_up()
    report.table(
        "All arcs (HiGHS dual simplex, no presolve), full and gated, against columns; M = 20 (n 20: 15); ms",
        ["window", "n", "K", "μ", "arcs", "columns", "ratio", "gated arcs", "columns", "ratio"],
        [ratios(case, options.seeds) for case in CASES],
    )
    report.table(
        "Live: building and solving the network at every frame, gated; cold, or warm-started; ms",
        ["solver", "n", "K", "M", "median", "p95", "max", "no program, %", "rounds"],
        [live_row(size, options.steps, warm=warm) for size in LIVE for warm in (False, True)],
    )
    report.table(
        "The live tracker in a crowd, HD, default settings and budget: windows and solves, ms",
        ["n", "K", "tracked", "median", "p95", "max", "solve p95", "stopped, %", "largest gap, %"],
        [crowd_row(size, CROWD_S, seed) for size in CROWDS for seed in range(options.seeds)],
    )
    report.table(
        "The integer optimum, and the largest gaps of columns' solution and bound, %; M = 20; ms",
        ["window", "n", "K", "μ", "median", "max", "answer", "bound"],
        [exact(case, options.seeds) for case in EXACT_CASES],
    )
    report.table(
        "Under a limit of work, ms on an ordinary machine: time, ms, and the largest gap, %; M = 15",
        ["window", "n", "K", "μ", "limit", "median", "max", "stopped", "gap"],
        [budget(case, work_s, options.seeds) for case in BUDGET_CASES for work_s in BUDGETS],
    )
    growth_table(report, SWEEPS, "Random windows (paper Fig. 21)", options, "fig21.png")
    growth_table(report, LAYOUT_SWEEPS, "People who meet, μ = .001", options, "fig21-layout.png")
    times = table1()
    report.table(
        "Table I: 3 objects, 50 observations, 20 frames; ms",
        ["solver", "time"],
        [[solver, f"{1e3 * value:.1f}"] for solver, value in times.items()],
    )
    plot_table1(times, options.out / "table1.png")
    report.save(options.out / "solvers.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "solvers")
    options.add_argument("--seeds", type=int, default=3, help="windows for each number")
    options.add_argument("--steps", type=int, default=60, help="windows of each live row")
    run(options.parse_args())


if __name__ == "__main__":
    main()
