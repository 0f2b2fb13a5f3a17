"""Growth of the solvers' times with the window, and the paper's Fig. 21 and Table I as plots."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.solvers.random_windows import WindowSize, meeting_window, random_window
from benchmarks.solvers.solver_times import REPEATS, WindowCase, seconds
from tracking.model.network import Network
from tracking.model.settings import PAPER_COSTS

SOLVERS = ("arcs", "columns")
TABLE1_SOLVERS = ("extended-dp", "arcs", "exact", "columns", "greedy-dp", "separate-dp")


@dataclass(frozen=True, slots=True)
class SizeSweep:
    """Sizes along one axis of Fig. 21; `values` are those on the axis."""

    label: str
    sizes: tuple[WindowSize, ...]
    values: tuple[int, ...]
    layout: float = 0.0
    """The weight μ of the layout term; with it, people meet instead of jumping at random."""
    arcs: int | None = None
    """Number of sizes for `arcs`, which takes minutes for more; None: all."""

    def network(self, size: WindowSize, seed: int) -> Network:
        """Build a window of that size."""
        if not self.layout:
            return random_window(size, PAPER_COSTS, seed)
        return WindowCase("meeting", meeting_window, size, self.layout).network(seed)


_PLACES, _OBJECTS, _FRAMES = (5, 10, 20, 40, 60), (1, 2, 4, 6, 8), (5, 10, 20, 40)

SWEEPS = (
    SizeSweep("observations a frame (3 objects)", tuple(WindowSize(3, k) for k in _PLACES), _PLACES),
    SizeSweep("objects (20 observations a frame)", tuple(WindowSize(n, 20) for n in _OBJECTS), _OBJECTS),
    SizeSweep("frames (3 objects, 20 observations)", tuple(WindowSize(3, 20, m) for m in _FRAMES), _FRAMES),
)

_MU = 0.001
LAYOUT_SWEEPS = (
    SizeSweep(
        "observations a frame (3 objects)", tuple(WindowSize(3, k) for k in _PLACES), _PLACES, _MU, arcs=3
    ),
    SizeSweep(
        "objects (20 observations a frame)",
        tuple(WindowSize(n, 20) for n in (2, 4, 8, 16)),
        (2, 4, 8, 16),
        _MU,
        arcs=2,
    ),
    SizeSweep(
        "frames (3 objects, 20 observations)",
        tuple(WindowSize(3, 20, m) for m in _FRAMES),
        _FRAMES,
        _MU,
        arcs=3,
    ),
)


@dataclass(frozen=True, slots=True)
class TimeGrowth:
    """The mean times of a solver along a sweep, and the exponent fitted to them."""

    sweep: SizeSweep
    solver: str
    times: tuple[float, ...]
    exponent: float


def paper_growth(size: WindowSize) -> float:
    """Return n² k m (2 log k + 2 log n + log m), the average complexity that II.D states."""
    n, k, m = size.objects, size.places, size.frames
    return float(n**2 * k * m * (2 * np.log(k) + 2 * np.log(n) + np.log(m)))


def exponent(sizes: tuple[WindowSize, ...], times: tuple[float, ...]) -> float:
    """Fit the e of time ~ (the paper's growth)^e; up to 1 is no worse than the paper's."""
    return float(np.polyfit(np.log([paper_growth(size) for size in sizes]), np.log(times), 1)[0])


def grown(sweep: SizeSweep, solver: str, seeds: int) -> TimeGrowth:
    """Time a solver along a sweep: means over windows, as in the paper."""
    repeats = REPEATS if solver != "arcs" else 1
    sizes = sweep.sizes[: sweep.arcs] if solver == "arcs" else sweep.sizes
    times = tuple(
        float(np.mean([seconds(solver, sweep.network(size, seed), repeats) for seed in range(seeds)]))
        for size in sizes
    )
    return TimeGrowth(sweep, solver, times, exponent(sizes, times))


def exponent_of_all(growths: list[TimeGrowth], solver: str) -> float:
    """Fit one exponent to all sweeps of a solver."""
    own = [growth for growth in growths if growth.solver == solver]
    sizes = tuple(size for growth in own for size in growth.sweep.sizes[: len(growth.times)])
    return exponent(sizes, tuple(time for growth in own for time in growth.times))


def plot_growth(growths: list[TimeGrowth], title: str, path: Path) -> None:
    """Draw time over observations, objects and frames."""
    from matplotlib.figure import Figure  # noqa: PLC0415 — loading it would count as a solver's time

    sweeps = list(dict.fromkeys(growth.sweep for growth in growths))
    figure = Figure(figsize=(13, 4), layout="constrained")
    for axis, sweep in zip(figure.subplots(1, len(sweeps)), sweeps, strict=True):
        for growth in growths:
            if growth.sweep == sweep:
                label = f"{growth.solver}, growth^{growth.exponent:.2f}"
                axis.plot(
                    sweep.values[: len(growth.times)], 1e3 * np.array(growth.times), marker="o", label=label
                )
        axis.set(xlabel=sweep.label, ylabel="processor time, ms", yscale="log")
        axis.legend()
    figure.suptitle(title)
    figure.savefig(path, dpi=120)


def table1() -> dict[str, float]:
    """Time all solvers at the size of Table I: three objects, 50 observations, 20 frames."""
    network = random_window(WindowSize(3, 50), PAPER_COSTS, 0)
    return {
        solver: seconds(solver, network, 1 if solver in {"extended-dp", "arcs"} else REPEATS)
        for solver in TABLE1_SOLVERS
    }


def plot_table1(times: dict[str, float], path: Path) -> None:
    """Draw Table I."""
    from matplotlib.figure import Figure  # noqa: PLC0415 — loading it would count as a solver's time

    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axis = figure.subplots()
    axis.barh(list(times), [1e3 * value for value in times.values()])
    axis.set(xlabel="processor time, ms (the paper: 20 s, and 18800 s for its extended DP)", xscale="log")
    axis.invert_yaxis()
    figure.savefig(path, dpi=120)
