"""The process that draws a floor plan: reads it on standard input, writes the picture to standard output."""

from __future__ import annotations

import io
import sys

import msgspec
import numpy as np

from server.service.calibration.floor_plan import plot_floor_plan
from server.service.calibration.floor_plan_camera import FloorPlanCamera
from server.service.calibration.plan_worker import DrawnPlan, PlanCamera, PlanRequest


def main() -> None:
    """Draw one plan for the process that started this one."""
    request = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=PlanRequest)
    png = io.BytesIO()
    plot_floor_plan([_view(camera) for camera in request.cameras], request.unit, png)
    sys.stdout.buffer.write(msgspec.msgpack.encode(DrawnPlan(png.getvalue())))


def _view(camera: PlanCamera) -> FloorPlanCamera:
    homography, image, floor = (
        np.array(values, dtype=np.float64)
        for values in (camera.homography, camera.image_points, camera.floor_points)
    )
    return FloorPlanCamera(camera.camera, homography, image, floor)


if __name__ == "__main__":
    main()
