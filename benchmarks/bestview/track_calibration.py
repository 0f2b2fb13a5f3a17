"""Homographies from the cameras' own tracks, by `myview calibrate`."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.bestview.camera_tracks import Rows
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.common.environment import ROOT, one_thread_environment
from tracking.motchallenge import write_rows

_PATIENCE_S = 600.0


class CannotCalibrateError(Exception):
    """There are no homographies; the text says why."""


def calibrated(case: BenchmarkScene, own: Rows, folder: Path) -> BenchmarkScene:
    """Return the scene with the homographies that its cameras' own tracks give, in place of any it has.

    Raises:
        CannotCalibrateError: the command found none.
    """
    work = folder / f"{case.name}-calibrated"
    work.mkdir()
    for camera, rows in own.items():
        write_rows(work / f"{camera}.txt", rows)
    out = work / "ground.json"
    width, height = next(iter(case.sizes.values()))
    words = ["calibrate", *(str(work / f"{camera}.txt") for camera in own), "--out", str(out), "--shift", "0"]
    words += ["--size", f"{width}x{height}", "--fps", str(case.content["site"]["fps"])]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "server.cli.main", *words],
            cwd=ROOT,
            env=one_thread_environment(),
            capture_output=True,
            text=True,
            timeout=_PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise CannotCalibrateError(f"not done in {_PATIENCE_S:g} s") from error
    if done.returncode != 0 or not out.exists():
        said = [line for line in done.stderr.splitlines() if line.strip()]
        raise CannotCalibrateError(said[-1].strip() if said else f"exit code {done.returncode}")
    return replace(case, content={**case.content, "ground": str(out)})
