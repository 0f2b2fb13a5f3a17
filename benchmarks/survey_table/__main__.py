"""The survey's Table 1, measured: occlusion, identities, targets, real time.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.survey_table --data ../shared/data --out out/bench

Todor (2009, section 7.5) rates trackers in words: whether they are robust to occlusion, track many targets,
keep identities and run in real time. Here each of them, and the network program, tracks the same people in
the same pictures with the same detections; the word is printed beside the measurement. Two columns that
cannot be measured (the distributions and motions that a method can represent) are left out.

An occlusion is a true person who is hidden and reappears. It is survived if their id in the second before is
that in the second after. Recordings: PETS 2009 and terrace where they are available, and synthetic rooms,
whose ground truth knows every hidden pixel. Targets: people with a correct box at a time, of those present.
The time is the tracker's alone, on one core.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import cv2
import matplotlib as mpl

from benchmarks.baselines import DetectedView
from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.survey_table.measured_row import REAL_TIME, TrackerRow, ViewMeasurement, combine, measure_view
from benchmarks.survey_table.plots import plot
from benchmarks.survey_table.survey_ratings import WORDS, SurveyRatings
from server.cli.track.command import config_for_video, detect_frames
from synthetic import Scene, write_recording
from tracking.motchallenge import read_rows
from tracking.registry import tracker_names

_RECORDED = (("pets09", "view1", 7.0), ("terrace", "c0", 25.0))
"""Scene, view, frames a second."""
_DRAWN = (("room", 6, 1), ("room", 8, 2))
"""Scene, people, seed."""
_DRAWN_S = 30.0
_QUICK = 150
"""Frames at the end of each view, where people are present."""


def recorded_views(data: Path) -> Iterator[DetectedView]:
    """Yield the available recordings."""
    for scene, name, rate in _RECORDED:
        video, truth = data / scene / f"{name}.mp4", data / scene / "gt" / f"{name}.txt"
        if video.is_file() and truth.is_file():
            yield _searched(f"{scene} {name}", video, truth, rate)


def render_views(seconds: float) -> Iterator[DetectedView]:
    """Yield renderings of the synthetic scenes with their detections."""
    for name, people, seed in _DRAWN:
        scene = Scene(name, cameras=1, objects=people, seed=seed)
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "scene"
            write_recording(scene, out, seconds)
            yield _searched(f"{name}, {people} people", out / "c0.mp4", out / "gt" / "c0.txt", scene.fps)


def _searched(name: str, video: Path, truth: Path, fps: float) -> DetectedView:
    return DetectedView(name, list(detect_frames(config_for_video(video, None, None))), read_rows(truth), fps)


def _shortened(view: DetectedView, frames: int) -> DetectedView:
    """Return the last frames of a view."""
    last = view.frames[-frames:]
    return DetectedView(view.name, last, [row for row in view.truth if row.frame > last[0].number], view.fps)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report = Report()
    table: dict[str, list[ViewMeasurement]] = {name: [] for name in tracker_names()}
    # One after the other: the pictures of all views together take gigabytes.
    for whole in chain(recorded_views(options.data), render_views(_DRAWN_S)):
        view = _shortened(whole, options.frames) if options.frames else whole
        for name, found in table.items():
            found.append(measure_view(view, name))
        report.table(
            f"{view.name}: {len(view.frames)} frames at {view.fps:.0f} fps",
            ["", "survived", "switches", "IDF1 %", "HOTA %", "targets", "ms", "fps"],
            [[name, *_cells(found[-1])] for name, found in table.items()],
        )
    rows = {name: combine(found) for name, found in table.items()}
    report.table(
        "Table 1 over all views: measured, and the survey's rating",
        ["", "occlusion", "", "identities", "", "targets", "", "real time", ""],
        [[name, *_with_words(row, WORDS.get(name, SurveyRatings()))] for name, row in rows.items()],
    )
    report.line(
        "occlusion: survived with the same id; identities: mean IDF1, switches; targets: people with a "
        f"correct box, of those present; real time: frames a second on the slowest view / {REAL_TIME:.0f}"
    )
    plot(table, options.out / "survey_table.png")
    report.save(options.out / "survey_table.txt")


def _cells(measurement: ViewMeasurement) -> list[str]:
    return [
        f"{measurement.survived} of {measurement.occlusions}",
        str(measurement.scores.switches),
        f"{100 * measurement.scores.idf1:.1f}",
        f"{100 * measurement.scores.hota:.1f}",
        f"{measurement.tracked:.1f} of {measurement.present:.1f}",
        f"{measurement.milliseconds:.1f}",
        f"{1e3 / measurement.milliseconds:.0f}",
    ]


def _with_words(row: TrackerRow, words: SurveyRatings) -> list[str]:
    return [
        f"{100 * row.survival_rate:.0f} %: {row.survived} of {row.occlusions}",
        words.occlusion,
        f"{100 * row.idf1:.0f} %, {row.switches}",
        words.identities,
        f"{row.tracked:.1f} of {row.present:.1f}",
        words.targets,
        f"{row.lowest_fps / REAL_TIME:.1f}",
        words.real_time,
    ]


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "survey_table")
    options.add_argument("--frames", type=int, help="of each view at most, its last ones")
    options.add_argument(
        "--quick", dest="frames", action="store_const", const=_QUICK, help=f"as --frames {_QUICK}"
    )
    measure(options.parse_args())


if __name__ == "__main__":
    main()
