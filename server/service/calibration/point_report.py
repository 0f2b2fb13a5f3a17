"""Calibrates from marked points, and reports the result as text, a ground file and a floor plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bestview.calibration import Floats, MarkedPoints, PointFit, agrees_with, fit_cameras
from server.service.calibration.calibration_report import ground_file_text
from server.service.calibration.floor_plan_camera import FloorPlanCamera
from server.service.calibration.points_file import PointFile, points_content

UNNAMED = "unit"
"""The floor's unit where none is given."""


@dataclass(frozen=True, slots=True)
class PresentGround:
    """The calibration that marked points replace.

    Attributes:
        unit: the floor's unit; None: it is not given.
        homographies: by camera, (3, 3) from its pixels to the floor.
    """

    unit: str | None = None
    homographies: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class PointReport:
    """The result of a calibration from marked points.

    Attributes:
        fits: by camera, the homography and its errors at the marked points.
        lines: the report: errors of each camera, and what becomes of those without points.
        ground: the text of the ground file.
        views: the floor plan.
    """

    fits: Mapping[str, PointFit]
    lines: tuple[str, ...]
    ground: str
    views: tuple[FloorPlanCamera, ...]


def calibrate_points(points: PointFile, unit: str, present: PresentGround | None = None) -> PointReport:
    """Fit homographies to marked points.

    A camera without points keeps its present homography if most points of another camera fit that camera's
    present one: then the present calibration is in the coordinates of the points. Otherwise it is left out.

    Raises:
        CalibrationError: there are too few points, or they contradict each other.
    """
    present = present or PresentGround()
    fits = fit_cameras(points.cameras)
    homographies = {camera: fit.homography for camera, fit in fits.items()}
    lines = [_line(camera, fits[camera.camera], unit) for camera in points.cameras]
    unmarked = {name: matrix for name, matrix in present.homographies.items() if name not in fits}
    if unmarked:
        agreeing = _agreeing(points.cameras, unit, present)
        homographies |= unmarked if agreeing else {}
        lines += [_unmarked_line(name, agreeing) for name in unmarked]
    more = {
        "residuals": {
            name: [float(f"{error:.4g}") for error in fit.floor_error] for name, fit in fits.items()
        },
        "points": points_content(points),
    }
    views = [
        FloorPlanCamera(camera.camera, homographies[camera.camera], camera.image, camera.floor)
        for camera in points.cameras
    ]
    return PointReport(fits, tuple(lines), ground_file_text(unit, homographies, more), tuple(views))


def _agreeing(cameras: Sequence[MarkedPoints], unit: str, present: PresentGround) -> str | None:
    """Return a camera whose points fit its present homography; None: there is none."""
    if (present.unit or UNNAMED) != unit:
        return None
    known = (camera for camera in cameras if camera.camera in present.homographies)
    return next(
        (camera.camera for camera in known if agrees_with(present.homographies[camera.camera], camera)), None
    )


def _unmarked_line(name: str, agreeing: str | None) -> str:
    if agreeing is not None:
        return (
            f"{name}: has no points and keeps its present homography: the points of {agreeing} agree with it"
        )
    return (
        f"{name}: left out: it has no points, and its present homography may be in other coordinates, since "
        "no camera's points agree with its own; mark four or more in it, or in a camera that has not moved"
    )


def _line(points: MarkedPoints, fit: PointFit, unit: str) -> str:
    count = len(points.image)
    if count == 4:  # noqa: PLR2004 — the minimum for a homography
        return f"{points.camera}: 4 pairs always fit exactly; a fifth would show errors"
    worst = int(np.argmax(fit.image_error))
    return (
        f"{points.camera}: {count} pairs, off by {np.median(fit.floor_error):.3g} {unit} (median), "
        f"{fit.floor_error.max():.3g} {unit} (most), in the picture {np.median(fit.image_error):.1f} and "
        f"{fit.image_error[worst]:.1f} pixels; the worst is {points.label(worst)}"
    )
