"""WILDTRACK's boxes as scenes: seven cameras over a square, without pictures, in grades of noise."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.environment import CannotRunError
from tracking.motchallenge import read_rows

GRADES = ("true", "mild", "strong", "mild-10fps")
_CAMERAS = tuple(f"c{index}" for index in range(7))
_SIZE, _FPS, _STEPS = (1920, 1080), 2.0, 5


def wildtrack(data: Path, folder: Path, grade: str, seed: int) -> BenchmarkScene:
    """Write the detections of a grade into a new folder; grades at 10 fps interpolate those at 2 fps.

    Raises:
        CannotRunError: the data is missing.
    """
    source = data / "wildtrack"
    if not source.is_dir():
        raise CannotRunError(f"needs {source}; --data or MYVIEW_TEST_DATA give the folder")
    noise, _, rate = grade.partition("-")
    steps = _STEPS if rate else 1
    out = folder / f"{grade}-{seed}"
    subprocess.run([sys.executable, source / "noise.py", noise, str(seed), out, str(steps)], check=True)
    width, height = _SIZE
    return BenchmarkScene(
        f"wildtrack {grade}",
        "seven cameras over a square, boxes with noise",
        {
            "site": {"name": "bench", "fps": _FPS * steps, "width": width, "height": height},
            "cameras": [{"id": camera, "source": "scene:none"} for camera in _CAMERAS],
            "ground": str((source / "ground.json").absolute()),
        },
        {camera: read_rows(out / "gt" / f"{camera}.txt") for camera in _CAMERAS},
        0.0,
        {camera: out / "det" / f"{camera}.txt" for camera in _CAMERAS},
    )
