"""How soon a camera says what is wrong with its picture, and how often it says so though nothing is.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.picture_condition --data ../shared/data --out out/bench
    OPENBLAS_NUM_THREADS=1 python -m benchmarks.picture_condition --scene terrace2 --scene pets09

A fault begins in the middle of each camera's recording and lasts to the end, for 12 seconds at most. A cell
has the number of cameras that report it, of all, the mean seconds until then, and what they report. *wrongly*
counts the reports in the undisturbed recordings, by hour, and the cameras that report something while the
light or the weather changes (`HARMLESS`). *ms* is processor time.
"""

from __future__ import annotations

import argparse
import copy
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.robustness.disturbances.base import Disturbance, Moment
from benchmarks.robustness.disturbances.catalog import CATALOG, STRENGTHS
from benchmarks.scene_runs.options import add_options, selected_scenes
from benchmarks.scene_runs.pipeline_run import length_in_frames, open_frames
from server.camera.sources import Image
from server.media.letterbox import Letterbox
from tracking.picture_condition import PictureMonitor
from tracking.types import PictureCondition

FAULTS = ("covered", "sprayed", "turned-away", "blur", "night", "frozen")
HARMLESS = (
    "gamma",
    "exposure",
    "sun",
    "flicker",
    "fog",
    "rain",
    "knock",
    "sway",
    "screen",
    "dropped",
    "doubled",
)
LASTS_S = 12.0


@dataclass(frozen=True, slots=True)
class FirstReport:
    """What a camera reported first, and after how many seconds."""

    condition: PictureCondition
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class CameraRun:
    """One camera's reports.

    Attributes:
        reports: by disturbance and strength; None: nothing was reported.
        alarms: reports of the undisturbed recording.
        seconds: its length.
        frame_ms: processor time of a frame.
    """

    reports: Mapping[str, FirstReport | None]
    alarms: int
    seconds: float
    frame_ms: float


def measure_camera(scene: BenchmarkScene, camera: str, frames: int, names: Sequence[str]) -> CameraRun:
    """Run one camera undisturbed, and from the middle on with each disturbance."""
    config = scene.config()
    fps, start = config.site.fps, frames // 2
    monitor, last, alarms = PictureMonitor(fps), "clear", 0
    disturbed: list[Image] = []
    before, spent = monitor, 0.0
    for frame, image in _pictures(scene, camera, frames):
        if frame == start:
            before = copy.deepcopy(monitor)
        if start <= frame < start + LASTS_S * fps:
            disturbed.append(image)
        began = time.process_time()
        condition = monitor.observe(image, frame)
        spent += time.process_time() - began
        alarms += condition not in {"clear", last}
        last = condition
    reports = {
        f"{name} {strength}": first_report(
            copy.deepcopy(before), CATALOG[name][strength], disturbed, start, fps
        )
        for name in names
        for strength in STRENGTHS
    }
    return CameraRun(reports, alarms, frames / fps, 1000.0 * spent / frames)


def first_report(
    monitor: PictureMonitor, disturbance: Disturbance, images: Sequence[Image], start: int, fps: float
) -> FirstReport | None:
    """Return what a monitor that knows the camera reports first in disturbed images."""
    effect = disturbance.begin()
    for index, image in enumerate(images):
        seconds = index / fps
        if disturbance.lasts_s is not None and seconds >= disturbance.lasts_s:
            break
        picture = effect(image, Moment(index, seconds, 1, 0))
        if picture is not None and monitor.observe(picture, start + index) != "clear":
            return FirstReport(monitor.condition, seconds)
    return None


def _pictures(scene: BenchmarkScene, camera: str, frames: int) -> Iterator[tuple[int, Image]]:
    config = scene.config()
    source = open_frames(config, camera, frames)
    letterbox = Letterbox(source.size, (config.site.width, config.site.height))
    try:
        for frame in range(frames):
            image = source.take(frame)
            if image is not None:
                yield frame, letterbox.image(image)
    finally:
        source.close()


def cell(reports: Sequence[FirstReport | None]) -> str:
    """Return how many of some cameras report, how soon, and what."""
    made = [report for report in reports if report is not None]
    text = f"{len(made)}/{len(reports)}"
    if not made:
        return text
    said = ", ".join(sorted({report.condition for report in made}))
    return f"{text} {np.mean([report.seconds for report in made]):.1f} s {said}"


def measure(options: argparse.Namespace) -> None:
    """Measure all scenes; print and save the table."""
    cv2.setNumThreads(1)
    report, names = Report(), options.disturbance or [*FAULTS, *HARMLESS]
    runs: dict[str, list[CameraRun]] = {}
    with tempfile.TemporaryDirectory(prefix="myview-picture-") as folder:
        for scene in selected_scenes(options, Path(folder), report):
            frames = min(length_in_frames(scene.config()), options.frames)
            cameras = scene.config().camera_ids
            runs[scene.name] = [measure_camera(scene, camera, frames, names) for camera in cameras]
            print(scene.name, flush=True)
    everything = [run for scene_runs in runs.values() for run in scene_runs]
    rows = [
        [key, *(cell([run.reports[key] for run in scene_runs]) for scene_runs in runs.values())]
        for key in everything[0].reports
    ]
    report.table("first report", ("", *runs), rows)
    hours = sum(run.seconds for run in everything) / 3600.0
    alarms = sum(run.alarms for run in everything)
    harmless = [
        reported for run in everything for key, reported in run.reports.items() if key.split()[0] in HARMLESS
    ]
    report.line(
        f"wrongly: {alarms} reports in {60.0 * hours:.1f} undisturbed minutes, {alarms / hours:.1f} an hour; "
        f"{sum(each is not None for each in harmless)} of {len(harmless)} harmless disturbances; "
        f"{np.mean([run.frame_ms for run in everything]):.2f} ms a frame"
    )
    report.save(options.out / "picture_condition.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "picture_condition")
    add_options(options)
    options.add_argument("--disturbance", action="append", choices=tuple(CATALOG), help="may be repeated")
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "picture_condition")


if __name__ == "__main__":
    main()
