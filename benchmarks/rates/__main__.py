"""What lower and higher frame rates cost.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.rates --data ../shared/data --out out/bench
    OPENBLAS_NUM_THREADS=1 python -m benchmarks.rates --scene terrace --rate 5

Lower rates leave frames of a recording out; the scores are of the frames that remain. The drawn room is drawn
anew at rates above its own. Columns are those of `benchmarks.robustness`; *cost* is the loss of joint IDF1
beside the recording's own rate, *ms* the processor time of one camera per second of the recording.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import cv2

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.detector_names import detector_settings
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.scene_runs.options import (
    DETECTION_COLUMNS,
    DRAWN,
    TRACK_COLUMNS,
    add_options,
    detection_cells,
    draw_room,
    selected_detectors,
    selected_scenes,
    track_cells,
)
from benchmarks.scene_runs.pipeline_run import length_in_frames, open_frames, run_scene
from benchmarks.scene_runs.scores import score_run
from server.camera.sources.frame_timing import frame_index
from server.cli.render.plots import new_figure, save_figure
from tracking.motchallenge import MotRow

RATES = (60.0, 50.0, 25.0, 12.5, 25.0 / 3.0, 5.0, 2.0)
SCENES = ("terrace", "terrace2", "pets09", DRAWN)
"""Those with ground truth."""
COLUMNS = ("frames a second", *DETECTION_COLUMNS, *TRACK_COLUMNS, "cost", "seen", "ms")


def at_rate(scene: BenchmarkScene, fps: float, folder: Path) -> BenchmarkScene | None:
    """Return a scene at another frame rate; None: it has no such rate.

    A room is drawn anew at a higher rate, into the folder.
    """
    own = float(scene.content["site"]["fps"])
    if fps > own:
        return draw_room(folder, fps) if scene.name.startswith(DRAWN) else None
    site = {**scene.content["site"], "fps": fps}
    gt = {camera: rows_at_rate(rows, own, fps) for camera, rows in scene.gt.items()}
    return replace(scene, content={**scene.content, "site": site}, gt=gt)


def rows_at_rate(rows: list[MotRow], own: float, fps: float) -> list[MotRow]:
    """Return the rows of the frames that a lower rate shows, with their numbers at that rate."""
    newest = {
        frame_index(number / own, fps): number
        for number in range(max((row.frame for row in rows), default=0))
    }
    shown = {number: index for index, number in newest.items()}
    return [replace(row, frame=shown[row.frame - 1] + 1) for row in rows if row.frame - 1 in shown]


def measure_scene(
    report: Report, scene: BenchmarkScene, detector: str, options: argparse.Namespace
) -> dict[float, float]:
    """Measure one scene with one detector, and print its table; return the joint IDF1 by rate."""
    own = float(scene.content["site"]["fps"])
    rates = [own, *(rate for rate in options.rate or RATES if abs(rate - own) > 0.01)]
    rows, joint = [], {}
    with tempfile.TemporaryDirectory(prefix="myview-rates-") as folder:
        for rate in rates:
            resampled = at_rate(scene, rate, Path(folder))
            if resampled is None:
                continue
            config = resampled.config(detect=detector_settings(detector))
            frames = min(length_in_frames(config), round(options.frames * rate / own))
            run = run_scene(
                config, {camera: open_frames(config, camera, frames) for camera in config.camera_ids}
            )
            score = score_run(config, resampled.gt, run, range(1, frames + 1), scene.min_visible)
            joint[rate] = 100.0 * score.tracks.joint.idf1
            rows.append(
                [
                    f"{rate:.1f}",
                    *detection_cells([score]),
                    *track_cells([score]),
                    f"{joint[own] - joint[rate]:.1f}",
                    f"{100 * score.visible:.1f}",
                    f"{1e3 * run.camera_s * rate / run.frames:.0f}",
                ]
            )
            print(" ".join(rows[-1]), flush=True)
    report.table(f"{scene.name}, {detector}: at {own:.1f} frames a second, and at other rates", COLUMNS, rows)
    return joint


def plot_rates(joint: Mapping[str, Mapping[float, float]], out: Path) -> None:
    """Draw the joint IDF1 over the rate, a line for each scene and detector."""
    figure = new_figure((6.5, 4.0))
    axis = figure.subplots()
    for title, scores in joint.items():
        rates = sorted(scores)
        axis.plot(rates, [scores[rate] for rate in rates], marker="o", label=title)
    axis.set(xscale="log", xlabel="frames a second", ylabel="joint IDF1", ylim=(0, 100))
    axis.set_xticks(RATES, [f"{rate:.3g}" for rate in RATES])
    axis.minorticks_off()
    axis.legend(fontsize="small")
    out.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, out)


def measure(options: argparse.Namespace) -> None:
    """Measure all scenes; print and save tables and plot."""
    cv2.setNumThreads(1)
    report = Report()
    joint: dict[str, Mapping[float, float]] = {}
    with tempfile.TemporaryDirectory(prefix="myview-rates-") as folder:
        for scene in selected_scenes(options, Path(folder), report):
            for detector in selected_detectors(options):
                joint[f"{scene.name}, {detector}"] = measure_scene(report, scene, detector, options)
    report.save(options.out / "rates.txt")
    plot_rates(joint, options.out / "rates.png")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "rates")
    add_options(options, SCENES)
    options.add_argument("--rate", action="append", type=float, help="frames a second; may be repeated")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "rates")


if __name__ == "__main__":
    main()
