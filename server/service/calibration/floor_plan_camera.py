"""What a floor plan shows of a camera; without the library that draws it."""

from __future__ import annotations

from dataclasses import dataclass

from bestview.calibration import Floats, WalkCalibration


@dataclass(frozen=True, slots=True)
class FloorPlanCamera:
    """One camera on the plan.

    Attributes:
        camera: its name.
        homography: its pixels to the floor, (3, 3).
        image_points: the points in its picture, (N, 2) pixels.
        floor_points: their positions on the floor, (N, 2): marked, or estimated from all cameras.
        floor: cameras of one number share a floor; each floor has a plan of its own.
    """

    camera: str
    homography: Floats
    image_points: Floats
    floor_points: Floats
    floor: int = 0


def floor_plan_cameras(calibration: WalkCalibration) -> list[FloorPlanCamera]:
    """Return the cameras of a calibration for the floor plan."""
    return [
        FloorPlanCamera(camera.camera, camera.homography, camera.image, camera.position, camera.floor)
        for camera in calibration.cameras
    ]
