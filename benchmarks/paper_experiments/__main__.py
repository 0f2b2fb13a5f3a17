"""The paper's tracking experiments (IV.A), repeated on synthetic scenes with ground truth.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.paper_experiments --out out/bench

Counts wrong labels per frame of the LP (`arcs`; in a long segment without a layout term `columns`, which
solves the same program), its exact optimum, greedy and separate dynamic programming, and the windows in which
the LP was integral: means over several scenes, beside the paper's figures of its own recordings. The
difficulty of the scenes is chosen here, to compare the solvers with each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.paper_experiments.experiment_list import EXPERIMENTS, Experiment, TrackerSetting
from benchmarks.paper_experiments.label_errors import LabelErrors, judge, per_frame
from benchmarks.paper_experiments.plots import plot
from benchmarks.paper_experiments.scene import ExperimentScene
from benchmarks.paper_experiments.windowed_tracking import TrackedLabels, follow
from tracking import SolverBudget, create_solver

_LP, _NOT_PLOTTED = ("arcs", "columns"), "exact"
BUDGET = SolverBudget(work_s=120.0)
"""Of each segment: branch and bound may take for ever under the layout term."""


@dataclass(frozen=True, slots=True, eq=False)
class SolverOutcome:
    """The labels of a solver in a scene, and their errors."""

    followed: TrackedLabels
    labels: LabelErrors

    @property
    def integral(self) -> int:
        """Windows whose linear program was integral."""
        return sum(report.integral for report in self.followed.reports)

    @property
    def stopped(self) -> int:
        """Windows that the budget ended."""
        return sum(report.limit is not None for report in self.followed.reports)

    @property
    def gap(self) -> float:
        """The largest proven distance of a window's cost from the optimum."""
        return max(report.gap for report in self.followed.reports)


def attempt(scene: ExperimentScene, setting: TrackerSetting, solver: str) -> SolverOutcome:
    """Track the objects of a scene, and count the errors of the labels."""
    followed = follow(scene, setting.costs, setting.window, create_solver(solver, BUDGET))
    return SolverOutcome(followed, judge(scene, followed.boxes))


def row(setting: TrackerSetting, solver: str, outcomes: list[SolverOutcome]) -> list[str]:
    """Return a row of the table."""
    labels = [outcome.labels for outcome in outcomes]
    windows = sum(len(outcome.followed.reports) for outcome in outcomes)
    integral = sum(outcome.integral for outcome in outcomes)
    stopped = sum(outcome.stopped for outcome in outcomes)
    return [
        f"{setting.name}: {solver}",
        _spread([per_frame(label.wrong) for label in labels]),
        _spread([per_frame(label.unlike) for label in labels]),
        _spread([per_frame(label.missing) for label in labels]),
        f"{integral} of {windows}{f', {stopped} stopped' * (stopped > 0)}" if solver in _LP else "",
        "" if solver == "separate-dp" else f"{100 * max(outcome.gap for outcome in outcomes):.2f}",
    ]


def _spread(values: list[float]) -> str:
    return f"{np.mean(values):.3f} ± {np.std(values):.3f}"


def run(experiment: Experiment, seeds: int | None, report: Report, out: Path) -> None:
    """Run one experiment, print its table and save its plot."""
    seeds = seeds or experiment.scenes
    scenes = [experiment.play(seed) for seed in range(1, seeds + 1)]
    rows = [
        [f"the paper's recording: {figure.solver}", figure.wrong, "", "", figure.integral, ""]
        for figure in experiment.paper
    ]
    for setting in experiment.settings:
        found = {name: [attempt(scene, setting, name) for scene in scenes] for name in setting.solvers}
        rows += [row(setting, name, outcomes) for name, outcomes in found.items()]
        if setting is experiment.settings[0]:
            plotted = [name for name in setting.solvers if name != _NOT_PLOTTED]
            shown = {name: (found[name][0].followed.boxes, found[name][0].labels) for name in plotted}
            title = f"{experiment.title}; as in the paper's {experiment.figure}"
            plot(scenes[0].truth, shown, title, out / f"paper_experiments-{experiment.name}.png")
    frames, observations = scenes[0].truth.frames, np.mean([scene.observations for scene in scenes])
    report.table(
        f"{experiment.title}: {seeds} scenes of {frames} frames, {observations:.0f} observations a frame",
        ["costs and windows: solver", "wrong per frame", "not its like", "missing", "integral", "gap, %"],
        rows,
    )


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "paper_experiments")
    names = [experiment.name for experiment in EXPERIMENTS]
    options.add_argument("--experiment", action="append", choices=names, help="only this one; repeatable")
    options.add_argument("--seeds", type=int, help="scenes of each experiment; otherwise 5, of the toys 3")
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    for experiment in EXPERIMENTS:
        if not chosen.experiment or experiment.name in chosen.experiment:
            run(experiment, chosen.seeds, report, chosen.out)
    report.line("wrong: a label on another object or on nothing; of these, unlike: on nobody of the same kit")
    report.line("integral: windows whose linear program was; stopped: by the budget; gap: to the best bound")
    report.line("missing: no label though its object is in view and was detected; ± over the scenes")
    report.line(
        "default: CostSettings and WindowSettings as they are (for the toys with c_a, c_b of sub-images)"
    )
    report.save(chosen.out / "paper_experiments.txt")


if __name__ == "__main__":
    main()
