"""The process that calibrates: a walk on standard input, what came of it on standard output."""

from __future__ import annotations

import io
import os
import sys

# Before NumPy is imported: the cameras need the cores, and this is in no hurry.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import numpy as np

from bestview.calibration import CalibrationError, Walk, build_walk
from server.service.calibration.calibration_report import (
    RecordedWalk,
    calibrate_walk,
    comparison_step,
    walk_settings,
)
from server.service.calibration.floor_plan import floor_plan_cameras, plot_floor_plan
from server.service.calibration.worker import CalibrationResult, CalibrationTask, CameraBoxes


def done(task: CalibrationTask) -> CalibrationResult:
    """Calibrate; say what has come of it, or why nothing has."""
    nobody = [it.camera for it in task.seen if not it.frames]
    walks = tuple(_walk(it, task.fps) for it in task.seen if it.frames)
    live = tuple(it.camera for it in walks if it.camera not in task.offsets)
    walked = RecordedWalk(walks, task.fps, offsets=task.offsets, live=live)
    try:
        outcome = calibrate_walk(walked, walk_settings(task.fps, task.shift), task.person)
    except CalibrationError as error:
        return CalibrationResult(error=str(error))
    plan = io.BytesIO()
    plot_floor_plan(floor_plan_cameras(outcome.found), "m", plan)
    lines = [*outcome.lines, *(f"{camera}: left out: nobody was seen" for camera in nobody)]
    return CalibrationResult(
        lines=lines,
        too_little=outcome.too_little,
        offsets=outcome.offsets,
        ground=outcome.ground,
        plan=plan.getvalue(),
    )


def _walk(seen: CameraBoxes, fps: float) -> Walk:
    frames, who = np.frombuffer(seen.frames, dtype=np.int64), np.frombuffer(seen.who, dtype=np.int64)
    boxes = np.frombuffer(seen.boxes, dtype=np.float64).reshape(-1, 4)
    return build_walk(seen.camera, seen.size, frames.tolist(), who.tolist(), boxes, comparison_step(fps))


def main() -> None:
    """Answer the process that started this one."""
    task = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=CalibrationTask)
    sys.stdout.buffer.write(msgspec.msgpack.encode(done(task)))


if __name__ == "__main__":
    main()
