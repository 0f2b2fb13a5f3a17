"""How much of people viewers see whose token blurs everybody, against ground truth.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.blurring --data ../shared/data --out out/bench
    OPENBLAS_NUM_THREADS=1 python -m benchmarks.blurring --scene room --detector background

Of every true box in every frame of every camera: *body* is the mean share of its area that is pixelated;
*head* the share of boxes of whose upper fifth at least 95 % are, *seen* the share of those of whose upper
fifth less than half are. *missed* is the share of people who are seen in half of their frames or more.
*whole* is the share of frames in which the whole picture is pixelated, since the camera had not looked,
*room* the share of the picture outside of all true boxes that is pixelated. The rows *boxes* are those of the
published boxes alone, without margin, hold and tracks that are not confirmed.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.detector_names import detector_settings
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.scene_runs.options import add_options, selected_detectors, selected_scenes
from benchmarks.scene_runs.pipeline_run import SceneRun, length_in_frames, open_frames, run_scene
from server.config.site_config import Config
from tracking.motchallenge import MotRow

COLUMNS = ("hidden by", "boxes", "body %", "head %", "seen %", "missed %", "whole %", "room %")
SCENES = ("terrace", "terrace2", "pets09", "room")
"""Those with ground truth."""
_HEAD = 0.2
"""The upper part of a box that counts as the head."""
_HIDDEN, _SEEN = 0.95, 0.5
"""Shares of the head from which it counts as hidden, and below which as seen."""

Mask = NDArray[np.bool_]
Box = tuple[float, float, float, float]
Hidden = Mapping[str, Mapping[int, Sequence[Box] | None]]
"""By camera and frame (from 0): the pixelated boxes; None: the whole picture."""


def fill(mask: Mask, box: Box) -> None:
    """Set the pixels of a box."""
    left, top, right, bottom = (max(0, round(edge)) for edge in box)
    mask[top:bottom, left:right] = True


def share(mask: Mask, box: Box) -> float:
    """Return the share of a box's pixels inside the picture that are set; 1 without any."""
    left, top, right, bottom = (max(0, round(edge)) for edge in box)
    part = mask[top:bottom, left:right]
    return float(part.mean()) if part.size else 1.0


def frames_of(rows: Sequence[MotRow], frames: int) -> Iterator[tuple[int, list[MotRow]]]:
    """Yield the frames, from 0, with their true boxes."""
    by_frame = defaultdict(list)
    for row in rows:
        by_frame[row.frame - 1].append(row)
    for frame in range(frames):
        yield frame, by_frame[frame]


def score(config: Config, truth: Mapping[str, Sequence[MotRow]], hidden: Hidden, frames: int) -> list[str]:
    """Return the cells of a row."""
    bodies, heads, room, whole = [], [], [], 0
    picture: Box = (0.0, 0.0, float(config.site.width), float(config.site.height))
    of_person: dict[tuple[str, int], list[float]] = defaultdict(list)
    for camera, rows in truth.items():
        for frame, people in frames_of(rows, frames):
            mask, outside = np.zeros((2, config.site.height, config.site.width), dtype=np.bool_)
            boxes = hidden[camera].get(frame)
            whole += boxes is None
            for box in [picture] if boxes is None else boxes:
                fill(mask, box)
            for row in people:
                left, top, right, bottom = row.box
                fill(outside, row.box)
                bodies.append(share(mask, row.box))
                heads.append(share(mask, (left, top, right, top + _HEAD * (bottom - top))))
                of_person[camera, row.id].append(heads[-1])
            room.append(mask[~outside].mean())
    head = np.array(heads)
    missed = [np.mean(np.array(shares) < _SEEN) >= _SEEN for shares in of_person.values()]
    shares = (
        np.mean(bodies),
        np.mean(head >= _HIDDEN),
        np.mean(head < _SEEN),
        np.mean(missed),
        whole / (frames * len(truth)),
        np.mean(room),
    )
    return [str(len(heads)), *(f"{100 * part:.1f}" for part in shares)]


def published(run: SceneRun, cameras: Sequence[str], frames: int) -> Hidden:
    """Return the published boxes as if they alone were pixelated."""
    hidden: dict[str, dict[int, list[Box]]] = {
        camera: {frame: [] for frame in range(frames)} for camera in cameras
    }
    for camera, rows in run.rendering.tracks.items():
        for row in rows:
            hidden[camera].setdefault(row.frame - 1, []).append(row.box)
    return hidden


def measure_scene(report: Report, scene: BenchmarkScene, detector: str, most: int) -> None:
    """Measure one scene with one detector, and print its table."""
    config = scene.config(detect=detector_settings(detector), access={"blur": "everybody"})
    frames = min(length_in_frames(config), most)
    run = run_scene(config, {camera: open_frames(config, camera, frames) for camera in config.camera_ids})
    hidden = {
        camera: {
            frame: None if regions is None else [region[1:] for region in regions]
            for frame, regions in by_frame.items()
        }
        for camera, by_frame in run.rendering.occupied.items()
    }
    rows = [
        ["regions", *score(config, scene.gt, hidden, frames)],
        ["boxes", *score(config, scene.gt, published(run, config.camera_ids, frames), frames)],
    ]
    report.table(f"{scene.name}, {detector}: {frames} frames of each camera", COLUMNS, rows)


def measure(options: argparse.Namespace) -> None:
    """Measure all scenes and detectors."""
    report = Report()
    with tempfile.TemporaryDirectory(prefix="myview-blurring-") as folder:
        for scene in selected_scenes(options, Path(folder), report):
            for detector in selected_detectors(options):
                measure_scene(report, scene, detector, options.frames)
    report.save(options.out / "blurring.txt")


def main() -> None:
    """Read the options and measure."""
    options = parser(__doc__, "blurring")
    add_options(options, SCENES)
    try:
        measure(options.parse_args())
    except CannotRunError as problem:
        finish(problem, "blurring")


if __name__ == "__main__":
    main()
