"""The scenes and detectors that benchmarks of whole runs can measure, and their common columns."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.bestview.scenes import BenchmarkScene, recorded, room
from benchmarks.common.environment import CannotRunError
from benchmarks.common.report import Report
from benchmarks.scene_runs.scores import SceneScores

RECORDED = ("terrace", "terrace2", "pets09", "campus4", "lab4")
DRAWN = "room"
ROOM_CAMERAS, ROOM_PEOPLE, ROOM_S = 3, 5, 30.0

DETECTION_COLUMNS = ("rec.", "prec.", "AP")
TRACK_COLUMNS = ("HOTA", "IDF1", "joint")
_ALL_FRAMES = 10**9


def add_options(options: argparse.ArgumentParser, scenes: Sequence[str] = (*RECORDED, DRAWN)) -> None:
    """Add the options that select scenes, detectors and frames."""
    options.add_argument("--scene", action="append", choices=scenes, help="may be repeated")
    options.add_argument(
        "--detector",
        action="append",
        help="a kind, an installed network, or both: fused+nanodet; may be repeated",
    )
    options.add_argument("--frames", type=int, default=_ALL_FRAMES, help="maximum of each camera")
    options.set_defaults(all_scenes=scenes)


def selected_detectors(options: argparse.Namespace) -> list[str]:
    """Return the selected detectors; the background detector if none is."""
    return list(options.detector or ["background"])


def selected_scenes(options: argparse.Namespace, folder: Path, report: Report) -> Iterator[BenchmarkScene]:
    """Yield the selected scenes one after the other; drawn ones are written into the folder.

    Those whose recordings are missing are reported.

    Raises:
        CannotRunError: all recordings are missing.
    """
    names, problems = options.scene or options.all_scenes, []
    for name in names:
        try:
            scene = draw_room(folder) if name == DRAWN else recorded(options.data, name)
        except CannotRunError as problem:
            report.line(f"{name}: skipped: {problem}")
            problems.append(problem)
        else:
            yield scene
    if len(problems) == len(names):
        raise problems[0]


def draw_room(folder: Path, fps: float = 25.0) -> BenchmarkScene:
    """Draw the synthetic room at a frame rate into a new folder."""
    return room(folder / f"{fps:g}", ROOM_CAMERAS, ROOM_PEOPLE, ROOM_S, fps)


def detection_cells(scores: Sequence[SceneScores]) -> list[str]:
    """Return the means of the detections' scores."""
    means = (
        np.mean([score.recall for score in scores]),
        np.mean([score.precision for score in scores]),
        np.mean([score.boxes.average_precision for score in scores]),
    )
    return [f"{mean:.2f}" for mean in means]


def track_cells(scores: Sequence[SceneScores]) -> list[str]:
    """Return the means of HOTA and IDF1 over the cameras, and of the joint IDF1, percent."""
    means = (
        np.mean([score.tracks.mean.hota for score in scores]),
        np.mean([score.tracks.mean.idf1 for score in scores]),
        np.mean([score.tracks.joint.idf1 for score in scores]),
    )
    return [f"{100 * mean:.1f}" for mean in means]
