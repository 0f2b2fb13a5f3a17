"""The survey's Table 1 with measurements in place of its words: occlusion, identities, targets, real time.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.survey_table --data ../shared/data --out out/bench

Todor (2009, section 7.5) compares trackers by words: whether they are robust to occlusion, follow many
targets, keep identities and run in real time. Here each of them, and the network program, follows the same
people in the same pictures with the same detections; beside what is measured stands the word. Two columns of
the words are no measurements (what distributions and motions a method can represent) and are left out.

An occlusion is a person of the truth who is hidden and comes back. Survived is that the number around whom
they are in the second before is the one in the second after. Recordings: PETS 2009 and terrace where they
are, and rooms that are drawn, whose truth knows every hidden pixel. Targets are how many people's boxes are
right at a time, of how many are there. The time is the tracker's alone, on one core.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import cv2
import matplotlib as mpl

from benchmarks.baselines import SearchedView
from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.survey_table.measured_row import REAL_TIME, TrackerRow, ViewMeasurement, measured, summed
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
"""Frames, the last ones of each view: there somebody is."""


def recorded(data: Path) -> Iterator[SearchedView]:
    """Yield the recordings that there are."""
    for scene, name, rate in _RECORDED:
        video, truth = data / scene / f"{name}.mp4", data / scene / "gt" / f"{name}.txt"
        if video.is_file() and truth.is_file():
            yield _searched(f"{scene} {name}", video, truth, rate)


def drawn(seconds: float) -> Iterator[SearchedView]:
    """Draw the scenes, as `myview scene` does, and search them."""
    for name, people, seed in _DRAWN:
        scene = Scene(name, cameras=1, objects=people, seed=seed)
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "scene"
            write_recording(scene, out, seconds)
            yield _searched(f"{name}, {people} people", out / "c0.mp4", out / "gt" / "c0.txt", scene.fps)


def _searched(name: str, video: Path, truth: Path, fps: float) -> SearchedView:
    return SearchedView(name, list(detect_frames(config_for_video(video, None, None))), read_rows(truth), fps)


def _shortened(view: SearchedView, frames: int) -> SearchedView:
    """Return the last frames of a view."""
    last = view.frames[-frames:]
    return SearchedView(view.name, last, [row for row in view.truth if row.frame > last[0].number], view.fps)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report = Report()
    table: dict[str, list[ViewMeasurement]] = {name: [] for name in tracker_names()}
    # One after the other: the pictures of all of them at once are gigabytes.
    for whole in chain(recorded(options.data), drawn(_DRAWN_S)):
        view = _shortened(whole, options.frames) if options.frames else whole
        for name, found in table.items():
            found.append(measured(view, name))
        report.table(
            f"{view.name}: {len(view.frames)} frames at {view.fps:.0f} fps",
            ["", "survived", "switches", "IDF1 %", "HOTA %", "targets", "ms", "fps"],
            [[name, *_cells(found[-1])] for name, found in table.items()],
        )
    rows = {name: summed(found) for name, found in table.items()}
    report.table(
        "Table 1, over all views: measured, and the survey's word",
        ["", "occlusion", "", "identities", "", "targets", "", "real time", ""],
        [[name, *_with_words(row, WORDS.get(name, SurveyRatings()))] for name, row in rows.items()],
    )
    report.say(
        "occlusion: survived with the number; identities: mean IDF1, switches; targets: people whose boxes "
        f"are right, of those there; real time: the slowest view's frames a second over {REAL_TIME:.0f}"
    )
    plot(table, options.out / "survey_table.png")
    report.save(options.out / "survey_table.txt")


def _cells(it: ViewMeasurement) -> list[str]:
    return [
        f"{it.kept} of {it.hidden}",
        str(it.scores.switches),
        f"{100 * it.scores.idf1:.1f}",
        f"{100 * it.scores.hota:.1f}",
        f"{it.followed:.1f} of {it.there:.1f}",
        f"{it.milliseconds:.1f}",
        f"{1e3 / it.milliseconds:.0f}",
    ]


def _with_words(row: TrackerRow, words: SurveyRatings) -> list[str]:
    return [
        f"{100 * row.share_kept:.0f} %: {row.kept} of {row.hidden}",
        words.occlusion,
        f"{100 * row.idf1:.0f} %, {row.switches}",
        words.identities,
        f"{row.followed:.1f} of {row.there:.1f}",
        words.targets,
        f"{row.slowest / REAL_TIME:.1f}",
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
