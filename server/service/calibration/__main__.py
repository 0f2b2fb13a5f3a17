"""The calibration process: reads a walk on standard input, writes the result to standard output."""

from __future__ import annotations

import io
import sys

import msgspec
import numpy as np

from bestview.calibration import CalibrationError, Walk, WalkSettings, build_walk
from server.service.calibration.calibration_report import RecordedWalk, calibrate_walk
from server.service.calibration.floor_plan import plot_floor_plan
from server.service.calibration.floor_plan_camera import floor_plan_cameras
from server.service.calibration.worker import CalibrationResult, CalibrationTask, CameraBoxes


def calibrate(task: CalibrationTask) -> CalibrationResult:
    """Calibrate; return the result, or why there is none."""
    empty = [boxes.camera for boxes in task.cameras if not boxes.frames]
    walks = tuple(_walk(boxes, task.fps) for boxes in task.cameras if boxes.frames)
    without_offset = tuple(walk.camera for walk in walks if walk.camera not in task.offsets)
    recorded = RecordedWalk(walks, task.fps, offsets=task.offsets, without_offset=without_offset)
    try:
        report = calibrate_walk(
            recorded, WalkSettings.at_rate(task.fps, task.max_offset_s), task.person_height
        )
    except CalibrationError as error:
        return CalibrationResult(error=str(error))
    plan = io.BytesIO()
    plot_floor_plan(floor_plan_cameras(report.calibration), "m", plan)
    lines = [*report.lines, *(f"{camera}: left out: no person was seen" for camera in empty)]
    return CalibrationResult(
        lines=lines,
        insufficient=report.insufficient,
        offsets=report.offsets,
        ground=report.ground,
        plan=plan.getvalue(),
    )


def _walk(camera: CameraBoxes, fps: float) -> Walk:
    frames, track = np.frombuffer(camera.frames, dtype=np.int64), np.frombuffer(camera.track, dtype=np.int64)
    boxes = np.frombuffer(camera.boxes, dtype=np.float64).reshape(-1, 4)
    return build_walk(camera.camera, camera.size, frames.tolist(), track.tolist(), boxes, fps)


def main() -> None:
    """Run one calibration for the process that started this one."""
    task = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=CalibrationTask)
    sys.stdout.buffer.write(msgspec.msgpack.encode(calibrate(task)))


if __name__ == "__main__":
    main()
