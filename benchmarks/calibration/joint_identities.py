"""Joint IDF1 of a recording with a calibration, and with others that differ by less than calibrations err.

One exchange of two people costs up to a fifth of the score: a single run cannot compare two calibrations.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.bestview.camera_tracks import track_scene
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.bestview.service_decisions import decide
from server.cli.render.video_info import Size
from server.service.calibration.calibration_report import ground_file_text
from tracking.boxes import Floats
from tracking.evaluation import TruthAndTracks, evaluate_cameras

_MOVED_PX = 0.5
"""Standard deviation by which the corners of the pictures are moved."""


@dataclass(frozen=True, slots=True)
class JointIdf1:
    """The joint IDF1 with a calibration as it is, and with each of the moved ones."""

    given: float
    moved: Sequence[float]


def joint_idf1(scene: BenchmarkScene, runs: int, folder: Path) -> JointIdf1:
    """Track a scene with its calibration, and in `runs` more with moved ones, which are written to `folder`.

    All share the detections, which were found with the calibration as it is.
    """
    config = scene.config()
    messages = track_scene(config, scene.detect().frames)
    scores = []
    for seed in range(runs + 1):
        ground = moved_ground(Path(scene.content["ground"]), scene.sizes, seed) if seed else None
        if ground is not None:
            path = folder / f"{scene.name}-moved-{seed}.json"
            path.write_text(ground, encoding="utf-8")
            config = replace(scene, content={**scene.content, "ground": str(path)}).config()
        tracks = decide(config, messages).tracks
        pairs = {camera: TruthAndTracks(rows, tracks[camera]) for camera, rows in scene.gt.items()}
        scores.append(evaluate_cameras(pairs).joint.idf1)
    return JointIdf1(scores[0], scores[1:])


def moved_ground(ground: Path, sizes: Mapping[str, Size], seed: int) -> str:
    """Return the text of a ground file in which the corners of each picture are moved a little."""
    content = json.loads(ground.read_text(encoding="utf-8"))
    random = np.random.default_rng(seed)
    homographies = {
        camera: np.array(matrix) @ _moved_picture(sizes[camera], random)
        for camera, matrix in sorted(content["homography"].items())
        if camera in sizes
    }
    return ground_file_text(content["unit"], homographies)


def _moved_picture(size: Size, random: np.random.Generator) -> Floats:
    """Return a homography (3, 3) of the picture that moves its corners."""
    width, height = size
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32)
    moved = corners + random.normal(0.0, _MOVED_PX, corners.shape).astype(np.float32)
    return np.asarray(cv2.getPerspectiveTransform(corners, moved), dtype=np.float64)
