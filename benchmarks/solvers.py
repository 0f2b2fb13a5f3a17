"""How fast the solvers of the tracking program are: a table, and the paper's Fig. 21 and Table I as plots.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.solvers --out out/solvers

Times are processor seconds of one thread, so that other work on the machine does not count; every ratio
is of times from the same run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.solver_windows import Size, moving_windows, random_window, walking_window
from tracking.network import CostSettings, Network, build_network
from tracking.presets import PAPER_COSTS
from tracking.solvers import solver_named

GATE = 60.0
"""Pixels a frame; people at 25 frames a second and CIF move a tenth of it."""

Window = Callable[[Size, CostSettings, int], Network]


@dataclass(frozen=True, slots=True)
class Case:
    """A row of the table."""

    name: str
    window: Window
    size: Size
    layout: float = 0.0


CASES = (
    Case("random", random_window, Size(3, 50)),
    Case("walking", walking_window, Size(3, 50)),
    Case("random", random_window, Size(10, 40)),
    Case("random", random_window, Size(20, 40)),
    Case("walking", walking_window, Size(20, 40)),
    Case("walking", walking_window, Size(3, 50), layout=0.001),
    Case("random", random_window, Size(3, 50), layout=0.001),
)
LIVE = (Size(8, 16, 15), Size(10, 40, 15), Size(20, 40, 15))
SWEEP_PLACES = (5, 10, 20, 40, 60)
SWEEP_OBJECTS = (1, 2, 4, 6, 8)


def seconds(solver: str, network: Network) -> float:
    """Give the processor time of one solve."""
    found = solver_named(solver)
    start = time.process_time()
    found.solve(network)
    return time.process_time() - start


def compare(case: Case, seeds: int) -> list[str]:
    """Time the full and the gated program against columns on the same networks; medians over seeds."""
    times = []
    for seed in range(seeds):
        row = []
        for gate in (None, GATE):
            network = case.window(case.size, replace(PAPER_COSTS, layout=case.layout, gate=gate), seed)
            row += [
                seconds("arcs", network),
                float(np.median([seconds("columns", network) for _ in range(3)])),
            ]
        times.append(row)
    full, columns, gated, gated_columns = np.median(times, axis=0)
    size = case.size
    return [
        case.name,
        f"{size.objects}",
        f"{size.places}",
        f"{case.layout:g}",
        f"{1e3 * full:.0f}",
        f"{1e3 * columns:.1f}",
        f"{full / columns:.0f}x",
        f"{1e3 * gated:.0f}",
        f"{1e3 * gated_columns:.1f}",
        f"{gated / gated_columns:.0f}x",
    ]


def live(size: Size, steps: int) -> list[str]:
    """Time windows at stride 1, the building of the network from boxes and histograms included."""
    solver, settings = solver_named("columns"), replace(PAPER_COSTS, gate=GATE)
    times = []
    for templates, frames in moving_windows(size, steps, seed=0):
        start = time.process_time()
        solver.solve(build_network(templates, frames, settings))
        times.append(1e3 * (time.process_time() - start))
    middle, late = np.percentile(times, [50, 95])
    return [
        f"{size.objects}",
        f"{size.places}",
        f"{size.frames}",
        f"{middle:.1f}",
        f"{late:.1f}",
        f"{max(times):.1f}",
    ]


def sweep(sizes: list[Size], seeds: int) -> dict[str, list[float]]:
    """Time `arcs` and `columns` over sizes of random windows, mean seconds as in the paper."""
    settings = PAPER_COSTS
    return {
        solver: [
            float(np.mean([seconds(solver, random_window(size, settings, seed)) for seed in range(seeds)]))
            for size in sizes
        ]
        for solver in ("arcs", "columns")
    }


def paper_growth(size: Size) -> float:
    """Give n² k m (2 log k + 2 log n + log m), the average complexity that II.D states."""
    n, k, m = size.objects, size.places, size.frames
    return float(n**2 * k * m * (2 * np.log(k) + 2 * np.log(n) + np.log(m)))


def growth(sizes: list[Size], times: list[float]) -> float:
    """Fit the exponent e of time ~ (the paper's growth)^e; up to 1 is no worse than the paper's."""
    return float(np.polyfit(np.log([paper_growth(size) for size in sizes]), np.log(times), 1)[0])


def plot_sweeps(folder: Path, seeds: int) -> list[str]:
    """Draw Fig. 21: time over observations and over objects; give a line on the growth of each."""
    from matplotlib import pyplot as plt  # noqa: PLC0415 — after the backend is chosen

    figure, axes = plt.subplots(1, 2, figsize=(10, 4))
    lines = []
    for axis, label, sizes, values in (
        (axes[0], "observations a frame (3 objects)", [Size(3, k) for k in SWEEP_PLACES], SWEEP_PLACES),
        (axes[1], "objects (20 observations a frame)", [Size(n, 20) for n in SWEEP_OBJECTS], SWEEP_OBJECTS),
    ):
        times = sweep(sizes, seeds)
        for solver, measured in times.items():
            exponent = growth(sizes, measured)
            axis.plot(values, 1e3 * np.array(measured), marker="o", label=f"{solver}, growth^{exponent:.2f}")
            lines.append(f"{label}: {solver} grows as (n² k m log)^{exponent:.2f}")
        axis.set(xlabel=label, ylabel="processor time, ms", yscale="log")
        axis.legend()
    figure.suptitle("Random windows of 20 frames (paper Fig. 21)")
    figure.tight_layout()
    figure.savefig(folder / "fig21.png", dpi=120)
    plt.close(figure)
    return lines


def plot_table1(folder: Path) -> list[str]:
    """Draw Table I: three objects, 50 observations, 20 frames."""
    from matplotlib import pyplot as plt  # noqa: PLC0415 — after the backend is chosen

    network = random_window(Size(3, 50), PAPER_COSTS, 0)
    solvers = ("extended-dp", "arcs", "exact", "columns", "greedy-dp", "separate-dp")
    times = [1e3 * seconds(solver, network) for solver in solvers]
    figure, axis = plt.subplots(figsize=(7, 3.5))
    axis.barh(solvers, times)
    axis.set(xlabel="processor time, ms (the paper: 20 s, and 18800 s for its extended DP)", xscale="log")
    axis.invert_yaxis()
    figure.tight_layout()
    figure.savefig(folder / "table1.png", dpi=120)
    plt.close(figure)
    return [f"{solver}: {value:.1f} ms" for solver, value in zip(solvers, times, strict=True)]


def show(console: Console, title: str, columns: list[str], rows: list[list[str]]) -> None:
    """Print a table."""
    table = Table(title=title)
    for column in columns:
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(*row)
    console.print(table)


def main() -> None:
    """Print the tables; draw the plots where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder for the plots; none: no plots")
    parser.add_argument("--seeds", type=int, default=2, help="windows for each number")
    parser.add_argument("--steps", type=int, default=60, help="windows of each live row")
    parser.add_argument("--layout", action="store_true", help="the cases with layout term, too: minutes")
    options = parser.parse_args()
    console = Console(width=120)
    seconds("columns", random_window(Size(2, 5, 3), PAPER_COSTS, 0))  # loads the solver
    cases = [case for case in CASES if options.layout or not case.layout]
    show(
        console,
        "Full and gated arc programs against columns; M = 20, times in ms",
        ["window", "n", "K", "μ", "arcs", "columns", "ratio", "gated arcs", "columns", "ratio"],
        [compare(case, options.seeds) for case in cases],
    )
    show(
        console,
        "Live: building the network and solving it at every frame, gated; ms",
        ["n", "K", "M", "median", "p95", "max"],
        [live(size, options.steps) for size in LIVE],
    )
    if options.out:
        mpl.use("Agg")
        options.out.mkdir(parents=True, exist_ok=True)
        for line in plot_table1(options.out) + plot_sweeps(options.out, options.seeds):
            console.print(line)


if __name__ == "__main__":
    main()
