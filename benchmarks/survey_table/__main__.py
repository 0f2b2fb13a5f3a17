"""The survey's Table 1, measured: occlusion, identities, targets, real time.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.survey_table --data ../shared/data --out out/bench

Todor (2009, section 7.5) rates trackers in words: whether they are robust to occlusion, track many targets,
keep identities and run in real time. Here each of them, and the network program, gets the same pictures and
detections; the rating is printed beside the measurement. Two columns that cannot be measured (the
distributions and motions that a method can represent) are omitted.

An occlusion is a true person who is hidden and reappears. It is survived if their id is the same in the
second before and the second after. Views: PETS 2009 and terrace if available, and synthetic rooms, whose
ground truth has every hidden pixel. Targets: people with a correct box at a time, of those present. Times are
the tracker's alone, on one core.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.baselines import DetectedView
from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.survey_table.measured_row import REAL_TIME, TrackerRow, ViewMeasurement, combine, measure_view
from server.cli.track.command import config_for_video, detect_frames
from synthetic import Scene, write_recording
from tracking.motchallenge import read_rows
from tracking.registry import tracker_names

_RECORDED = (("pets09", "view1", 7.0), ("terrace", "c0", 25.0))
"""Scene, view, frame rate."""
_DRAWN = (("room", 6, 1), ("room", 8, 2))
"""Scene, people, seed."""
_DRAWN_S = 30.0
_QUICK = 150
"""Frames at the end of each view, where people are present."""
_BAR_WIDTH = 0.8


@dataclass(frozen=True, slots=True)
class SurveyRatings:
    """The ratings of a tracker; empty where the survey has none."""

    occlusion: str = ""
    targets: str = ""
    identities: str = ""
    real_time: str = ""


RATINGS = {
    "klt": SurveyRatings("No", "Yes", "No", "Yes"),
    "mean-shift": SurveyRatings("No", "No", "No", "Yes"),
    "kalman": SurveyRatings("Some", "No", "No", "Yes"),
    **dict.fromkeys(
        ("particle", "joint-particles", "contour-particles"), SurveyRatings("Some", "Yes", "No", "Yes")
    ),
    **dict.fromkeys(("mcmc", "rjmcmc"), SurveyRatings("Some", "Yes", "No", "Yes")),
    **dict.fromkeys(("track-graph", "track-network"), SurveyRatings("Some", "Yes", "Yes", "No")),
}
"""Ratings of the survey's Table 1, for the measured columns (Todor 2009, section 7.5).

It has one row each for particle filters, MCMC and track graphs; their kinds are measured apart here."""


def recorded_views(data: Path) -> Iterator[DetectedView]:
    """Yield the available recordings."""
    for scene, name, rate in _RECORDED:
        video, truth = data / scene / f"{name}.mp4", data / scene / "gt" / f"{name}.txt"
        if video.is_file() and truth.is_file():
            yield _detected_view(f"{scene} {name}", video, truth, rate)


def render_views(seconds: float) -> Iterator[DetectedView]:
    """Yield renderings of the synthetic scenes with their detections."""
    for name, people, seed in _DRAWN:
        scene = Scene(name, cameras=1, objects=people, seed=seed)
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "scene"
            write_recording(scene, out, seconds)
            yield _detected_view(f"{name}, {people} people", out / "c0.mp4", out / "gt" / "c0.txt", scene.fps)


def _detected_view(name: str, video: Path, truth: Path, fps: float) -> DetectedView:
    return DetectedView(name, list(detect_frames(config_for_video(video, None, None))), read_rows(truth), fps)


def _last_frames(view: DetectedView, frames: int) -> DetectedView:
    """Return the last frames of a view."""
    last = view.frames[-frames:]
    return DetectedView(view.name, last, [row for row in view.truth if row.frame > last[0].number], view.fps)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report = Report()
    table: dict[str, list[ViewMeasurement]] = {name: [] for name in tracker_names()}
    # One after the other: the pictures of all views together take gigabytes.
    for full_view in chain(recorded_views(options.data), render_views(_DRAWN_S)):
        view = _last_frames(full_view, options.frames) if options.frames else full_view
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
        [[name, *_with_ratings(row, RATINGS.get(name, SurveyRatings()))] for name, row in rows.items()],
    )
    report.line(
        "occlusion: survived with the same id; identities: mean IDF1, switches; targets: people with a "
        f"correct box, of those present; real time: frame rate on the slowest view / {REAL_TIME:.0f}"
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


def _with_ratings(row: TrackerRow, ratings: SurveyRatings) -> list[str]:
    return [
        f"{100 * row.survival_rate:.0f} %: {row.survived} of {row.occlusions}",
        ratings.occlusion,
        f"{100 * row.idf1:.0f} %, {row.switches}",
        ratings.identities,
        f"{row.tracked:.1f} of {row.present:.1f}",
        ratings.targets,
        f"{row.lowest_fps / REAL_TIME:.1f}",
        ratings.real_time,
    ]


def plot(table: Mapping[str, Sequence[ViewMeasurement]], path: Path) -> None:
    """Draw survived occlusions, identities, targets and speed of each tracker, over all views."""
    rows: dict[str, TrackerRow] = {name: combine(found) for name, found in table.items()}
    panels = (
        ("occlusions survived, %", [100 * row.survival_rate for row in rows.values()]),
        ("IDF1, %", [100 * row.idf1 for row in rows.values()]),
        (
            "people with a correct box, of those present, %",
            [100 * row.tracked / row.present for row in rows.values()],
        ),
        (f"times {REAL_TIME:.0f} fps, slowest view", [row.lowest_fps / REAL_TIME for row in rows.values()]),
    )
    figure = Figure(figsize=(12, 0.7 + 0.42 * len(rows)))
    axes = figure.subplots(1, len(panels), sharey=True)
    places = np.arange(len(rows))
    for axis, (label, values) in zip(axes, panels, strict=True):
        axis.barh(places, values, _BAR_WIDTH)
        axis.set(xlabel=label)
        axis.grid(axis="x", alpha=0.3)
    axes[-1].set_xscale("log")
    axes[-1].axvline(1.0, color="red", linewidth=1)
    axes[0].set_yticks(places, list(rows))
    axes[0].invert_yaxis()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "survey_table")
    options.add_argument("--frames", type=int, help="only the last frames of each view")
    options.add_argument(
        "--quick", dest="frames", action="store_const", const=_QUICK, help=f"as --frames {_QUICK}"
    )
    measure(options.parse_args())


if __name__ == "__main__":
    main()
