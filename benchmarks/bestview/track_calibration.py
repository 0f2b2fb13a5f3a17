"""Calibration of a scene from its cameras' tracks, by `myview calibrate`."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.bestview.camera_tracks import Rows
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.environment import ROOT, one_thread_environment
from tracking.motchallenge import write_rows

_TIMEOUT_S = 600.0


class CannotCalibrateError(Exception):
    """Calibration failed; the text says why."""


def calibrated(scene: BenchmarkScene, tracks: Rows, folder: Path) -> BenchmarkScene:
    """Return the scene with homographies from its cameras' tracks.

    Raises:
        CannotCalibrateError: the command failed.
    """
    work = folder / f"{scene.name}-calibrated"
    work.mkdir()
    for camera, rows in tracks.items():
        write_rows(work / f"{camera}.txt", rows)
    out = work / "ground.json"
    width, height = next(iter(scene.sizes.values()))
    command = [
        "calibrate",
        *(str(work / f"{camera}.txt") for camera in tracks),
        "--out",
        str(out),
        "--shift",
        "0",
    ]
    command += ["--size", f"{width}x{height}", "--fps", str(scene.content["site"]["fps"])]
    try:
        process = subprocess.run(
            [sys.executable, "-m", "server.cli.main", *command],
            cwd=ROOT,
            env=one_thread_environment(),
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise CannotCalibrateError(f"not finished in {_TIMEOUT_S:g} s") from error
    if process.returncode != 0 or not out.exists():
        stderr_lines = [line for line in process.stderr.splitlines() if line.strip()]
        raise CannotCalibrateError(
            stderr_lines[-1].strip() if stderr_lines else f"exit code {process.returncode}"
        )
    return replace(scene, content={**scene.content, "ground": str(out)})
