"""What disturbances of the picture cost, and when all is as before.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.robustness --data ../shared/data --out out/bench
    OPENBLAS_NUM_THREADS=1 python -m benchmarks.robustness --scene terrace --disturbance gamma

A disturbance begins in the middle of a recording (`--start`), a little later with each `--seed`. The pictures
are disturbed one by one on their way into the cameras' pipelines, and the true boxes move with them; people
who can no longer be seen in a camera do not count there.

*rec.*, *prec.*, *AP* are of all cameras' detections since the disturbance began, the first two of confident
ones; *HOTA* and *IDF1* are means over the cameras, *joint* is the IDF1 over all cameras, of the whole
recording. *cost* is the loss of joint IDF1 in points, on the people who can still be seen; *worst* is the
largest of all seeds. *later* is the joint
IDF1 of what follows 10 seconds after the beginning, scored as a recording of its own, with its loss. *seen*
is the share of the frames since the beginning in which a person's chosen view shows them. *recovery* is the
time after the beginning from which the F1 score of the tracks' boxes over 2 seconds stays within .1 of the
undisturbed run's.

Scenes without ground truth are compared with the tracks of their undisturbed run.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.detector_names import detector_settings
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.robustness.cases import FIRST_SEED, Case, DisturbedScene
from benchmarks.robustness.disturbances.catalog import CATALOG, STRENGTHS
from benchmarks.robustness.plots import plot_costs
from benchmarks.scene_runs.options import (
    DETECTION_COLUMNS,
    TRACK_COLUMNS,
    add_options,
    detection_cells,
    selected_detectors,
    selected_scenes,
    track_cells,
)
from benchmarks.scene_runs.pipeline_run import length_in_frames

COLUMNS = (*("", *DETECTION_COLUMNS, *TRACK_COLUMNS, "cost", "worst", "later", "cost", "seen", "recovery"),)


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A disturbance of one strength, with all seeds."""

    name: str
    cases: Sequence[Case]

    @property
    def cost(self) -> float:
        """The mean loss of joint IDF1, in points."""
        return float(np.mean([case.cost for case in self.cases]))

    def cells(self) -> list[str]:
        """Return the row's cells."""
        since = [case.disturbed.since for case in self.cases]
        later = np.mean([case.disturbed.later_joint for case in self.cases])
        later_cost = np.mean([case.later_cost for case in self.cases])
        recovery = max(case.recovery_s for case in self.cases)
        return [
            self.name,
            *detection_cells(since),
            *track_cells([case.disturbed.whole for case in self.cases]),
            f"{self.cost:.1f}",
            f"{max(case.cost for case in self.cases):.1f}",
            *((f"{later:.1f}", f"{later_cost:.1f}") if np.isfinite(later) else ("", "")),
            f"{100 * np.mean([score.visible for score in since]):.1f}",
            "never" if np.isinf(recovery) else f"{recovery:.1f} s",
        ]


def measure_scene(
    report: Report, scene: BenchmarkScene, detector: str, options: argparse.Namespace
) -> list[Row]:
    """Measure one scene with one detector, and print its table."""
    config = scene.config(detect=detector_settings(detector))
    frames = min(length_in_frames(config), options.frames)
    start = frames // 2 if options.start is None else options.start
    disturbed = DisturbedScene(scene, config, start, frames)
    rows = [Row("undisturbed", [Case(disturbed.undisturbed, disturbed.undisturbed, 0.0)])]
    for name in options.disturbance or CATALOG:
        for strength in options.strength or STRENGTHS:
            cases = [
                disturbed.measure(CATALOG[name][strength], number) for number in options.seed or [FIRST_SEED]
            ]
            rows.append(Row(f"{name} {strength}", cases))
            print(" ".join(rows[-1].cells()), flush=True)
    against = "" if scene.gt else ", against the tracks of the undisturbed run"
    title = f"{scene.name}, {detector}: {frames} frames, disturbed from {start} on{against}"
    report.table(title, COLUMNS, [row.cells() for row in rows])
    return rows


def measure(options: argparse.Namespace) -> None:
    """Measure all scenes; print and save tables and plot."""
    cv2.setNumThreads(1)
    report = Report()
    costs: dict[str, Mapping[str, float]] = {}
    with tempfile.TemporaryDirectory(prefix="myview-robustness-") as folder:
        for scene in selected_scenes(options, Path(folder), report):
            for detector in selected_detectors(options):
                rows = measure_scene(report, scene, detector, options)
                costs[f"{scene.name}, {detector}"] = {row.name: row.cost for row in rows[1:]}
    report.save(options.out / "robustness.txt")
    plot_costs(costs, options.out / "robustness.png")


def seed(text: str) -> int:
    """Return a seed.

    Raises:
        ValueError: it is less than the first.
    """
    number = int(text)
    if number < FIRST_SEED:
        raise ValueError(text)
    return number


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "robustness")
    add_options(options)
    options.add_argument("--disturbance", action="append", choices=tuple(CATALOG), help="may be repeated")
    options.add_argument("--strength", action="append", choices=STRENGTHS, help="may be repeated")
    options.add_argument(
        "--seed", action="append", type=seed, help=f"may be repeated; {FIRST_SEED} if not given"
    )
    options.add_argument("--start", type=int, help="first disturbed frame, from 0; the middle if not given")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "robustness")


if __name__ == "__main__":
    main()
