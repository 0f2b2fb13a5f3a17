"""Who is who on a shared floor: one program over all cameras, beside tracking in each and joining afterwards.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.ground_plane --data ../shared/data --out out/bench
    OPENBLAS_NUM_THREADS=1 python -m benchmarks.ground_plane --scene "wildtrack strong" --seeds 3

All methods get the same detections, and none is tuned to a scene. *Joint program* is `tracking.ground_plane`;
*in the service* with identities after it. *Per camera, joined* is what the service does where views do not
overlap: a tracker per camera, and identities across cameras from their tracks. *Per camera alone* has ids of
its own in every camera: its mean is what a camera knows by itself.
*Frame by frame* finds places from all cameras in each frame as the joint program does, and links them by the
Hungarian method with constant velocity. Scores are means over the seeds, with half of their range; *ms* is
processor time per frame of all cameras together.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from benchmarks.bestview.scenes import BenchmarkScene, recorded, room
from benchmarks.common.detector_names import detector_settings
from benchmarks.common.environment import CannotRunError, parser
from benchmarks.common.report import Report
from benchmarks.ground_plane.methods import (
    ALONE,
    BY_FRAME,
    JOINED,
    JOINT,
    NEAREST,
    SERVED,
    MethodScore,
    run_methods,
)
from benchmarks.ground_plane.wildtrack import GRADES, wildtrack
from server.cli.render.plots import new_figure, save_figure

METHODS = (JOINT, SERVED, BY_FRAME, JOINED, NEAREST, ALONE)
WILDTRACK = tuple(f"wildtrack {grade}" for grade in GRADES)
RECORDED = ("terrace", "terrace2")
ROOMS = {"room-4-8": (4, 8, 40.0), "room-8-20": (8, 20, 30.0)}
"""Cameras, people, seconds."""
COLUMNS = ("", "joint", "mean", "MOTA", "Rcll", "Prcn", "IDSW", "IDs", "true", "ms")


def scenes(name: str, options: argparse.Namespace, folder: Path) -> Iterator[BenchmarkScene]:
    """Yield a scene, in as many draws as there are seeds if something is drawn."""
    if name in WILDTRACK:
        for seed in range(1, options.seeds + 1):
            yield wildtrack(options.data, folder, name.partition(" ")[2], seed)
    elif name in ROOMS:
        yield room(folder, *ROOMS[name])
    else:
        yield recorded(options.data, name)


def score_row(scores: Sequence[MethodScore]) -> list[str]:
    """Return the row of a method: percent and counts, means over the seeds."""
    joint = [score.scores.joint for score in scores]
    shares = [
        (each.idf1, score.scores.mean.idf1, each.mota, each.recall, each.precision)
        for score, each in zip(scores, joint, strict=True)
    ]
    counts = [(each.switches, each.tracks, each.objects) for each in joint]
    return [
        scores[0].method,
        _mean_and_range([100 * row[0] for row in shares]),
        *(f"{100 * mean:.1f}" for mean in np.mean(shares, axis=0)[1:]),
        *(f"{mean:.0f}" for mean in np.mean(counts, axis=0)),
        f"{np.median([score.ms for score in scores]):.1f}",
    ]


def _stage_times(scores: Sequence[MethodScore]) -> str:
    """Return the median of each stage's time over the seeds."""
    medians = {stage: np.median([score.stages[stage] for score in scores]) for stage in scores[0].stages}
    return ", ".join(f"{stage} {ms:.1f}" for stage, ms in medians.items())


def _mean_and_range(values: Sequence[float]) -> str:
    half = (max(values) - min(values)) / 2.0
    return f"{np.mean(values):.1f}" + (f" ±{half:.1f}" if len(values) > 1 else "")


def plot(joint: Mapping[str, Mapping[str, float]], out: Path) -> None:
    """Draw the joint IDF1 of every method, a group of bars for each scene."""
    figure = new_figure((7.0, 1.0 + 0.9 * len(joint)))
    axis = figure.subplots()
    places = np.arange(len(joint))[::-1]
    methods = [method for method in METHODS if any(method in scores for scores in joint.values())]
    for index, method in enumerate(methods):
        values = [scores.get(method, np.nan) for scores in joint.values()]
        axis.barh(places - 0.16 * (index - (len(methods) - 1) / 2), values, 0.15, label=method)
    axis.set(xlim=(0, 100), xlabel="joint IDF1", yticks=places, yticklabels=list(joint))
    axis.legend(fontsize="small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    out.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, out)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    cv2.setNumThreads(1)
    report = Report()
    joint: dict[str, dict[str, float]] = {}
    detect = detector_settings(options.detector)
    with tempfile.TemporaryDirectory(prefix="myview-ground-plane-") as folder:
        for name in options.scene or (*WILDTRACK, *RECORDED, *ROOMS):
            scores: dict[str, list[MethodScore]] = {}
            try:
                for scene in scenes(name, options, Path(folder)):
                    found = scene.with_detector(detect)
                    for score in run_methods(
                        found, found.detect(), options.method or list(METHODS), options.solver
                    ):
                        scores.setdefault(score.method, []).append(score)
            except CannotRunError as problem:
                report.line(f"{name}: skipped: {problem}")
                continue
            report.table(name, COLUMNS, [score_row(found) for found in scores.values()])
            for method, draws in scores.items():
                if draws[0].stages:
                    report.line(f"{method}, ms by stage: {_stage_times(draws)}")
            joint[name] = {
                method: 100 * float(np.mean([score.scores.joint.idf1 for score in found]))
                for method, found in scores.items()
            }
    report.line("joint, mean: IDF1 of all cameras together, and the mean of each. IDs: tracks; true: people.")
    report.save(options.out / "ground_plane.txt")
    if joint:
        plot(joint, options.out / "ground_plane.png")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "ground_plane")
    options.add_argument(
        "--scene", action="append", choices=(*WILDTRACK, *RECORDED, *ROOMS), help="may be repeated"
    )
    options.add_argument("--method", action="append", choices=METHODS, help="may be repeated")
    options.add_argument("--seeds", type=int, default=3, help="draws of the noise")
    options.add_argument("--solver", default="arcs", help="of the joint program")
    options.add_argument(
        "--detector", default="background", help="in pictures: a kind, a network, or both: fused+nanodet"
    )
    measure(options.parse_args())


if __name__ == "__main__":
    main()
