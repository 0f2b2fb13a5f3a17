"""Messages to and from the process that draws a floor plan, MessagePack, and the function that runs it."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import msgspec

from server.service.calibration.floor_plan_camera import FloorPlanCamera
from server.system.worker.process import WorkerDiedError
from server.system.worker.single_request import ask_new_worker

_PROCESS = "server.service.calibration.plan_process"
_WITHIN_S = 90.0

log = logging.getLogger(__name__)

Points = list[tuple[float, float]]


class PlanCamera(msgspec.Struct, frozen=True):
    """One camera on the plan, as a FloorPlanCamera."""

    camera: str
    homography: list[list[float]]
    image_points: Points
    floor_points: Points


class PlanRequest(msgspec.Struct, frozen=True):
    """A floor plan to draw, and the unit of its axes."""

    cameras: list[PlanCamera]
    unit: str


class DrawnPlan(msgspec.Struct, frozen=True):
    """A floor plan as PNG."""

    png: bytes


async def draw_floor_plan(views: Sequence[FloorPlanCamera], unit: str) -> bytes:
    """Return the floor plan as PNG; empty if it cannot be drawn, with a line in the log."""
    cameras = [
        PlanCamera(
            view.camera, view.homography.tolist(), view.image_points.tolist(), view.floor_points.tolist()
        )
        for view in views
    ]
    try:
        answer = await ask_new_worker(_PROCESS, PlanRequest(cameras, unit), DrawnPlan, _WITHIN_S)
    except (TimeoutError, OSError, WorkerDiedError) as error:
        log.error("the floor plan cannot be drawn: %s", error)  # noqa: TRY400
        return b""
    return answer.png
