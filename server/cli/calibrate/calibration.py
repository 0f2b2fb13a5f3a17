"""``myview calibrate``: homographies of cameras from marked points or walks, with their errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bestview.calibration import CalibrationError, MarkedPoints, PointFit, WalkSettings, fit_cameras
from server.cli.calibrate.points_file import read_points
from server.config.ground_unit import check_unit_spelling
from server.service.calibration.calibration_report import RecordedWalk, calibrate_walk, ground_file_text
from server.service.calibration.floor_plan import FloorPlanCamera, floor_plan_cameras, plot_floor_plan
from server.system.errors import UserError

_UNNAMED = "unit"


def calibrate_points(points: Path, out: Path, plan: Path, unit: str | None) -> list[str]:
    """Fit homographies to marked points, and write the ground file and the floor plan.

    Returns:
        Lines to print.

    Raises:
        UserError: the file is invalid, or its points contradict each other.
    """
    chosen_unit = None if unit is None else _checked("--unit", unit)
    marked = read_points(points)
    unit = chosen_unit or _checked(f"{points}: unit", marked.unit or _UNNAMED)
    with refusing(points):
        fits = fit_cameras(marked.cameras)
    views = [
        FloorPlanCamera(points.camera, fits[points.camera].homography, points.image, points.floor)
        for points in marked.cameras
    ]
    plot_floor_plan(views, unit, plan)
    homographies = {camera: fit.homography for camera, fit in fits.items()}
    residuals = {name: _rounded(fit) for name, fit in fits.items()}
    out.write_text(ground_file_text(unit, homographies, {"residuals": residuals}), encoding="utf-8")
    return [_line(camera, fits[camera.camera], unit) for camera in marked.cameras]


def calibrate_from_walks(
    walk: RecordedWalk, out: Path, plan: Path, settings: WalkSettings, person_height: float, *, force: bool
) -> list[str]:
    """Calibrate from walks, and write the ground file and the floor plan.

    Returns:
        Lines to print.

    Raises:
        UserError: the walk covered too little.
    """
    with refusing("calibrate"):
        outcome = calibrate_walk(walk, settings, person_height)
    if outcome.insufficient and not force:
        raise UserError(
            f"calibrate: the walk covered too little: {outcome.insufficient} (--force writes it anyway)"
        )
    plot_floor_plan(floor_plan_cameras(outcome.calibration), "m", plan)
    out.write_text(outcome.ground, encoding="utf-8")
    offsets = ["for the configuration:", *outcome.offsets.splitlines()] if outcome.offsets else []
    return [*outcome.lines, *offsets]


@contextmanager
def refusing(source: Path | str) -> Iterator[None]:
    """Turn a CalibrationError into a UserError that names the input."""
    try:
        yield
    except CalibrationError as error:
        raise UserError(f"{source}: {error}") from error


def _checked(where: str, unit: str) -> str:
    try:
        return check_unit_spelling(unit)
    except ValueError as error:
        raise UserError(f"{where}: {error}") from error


def _rounded(fit: PointFit) -> list[float]:
    return [float(f"{error:.4g}") for error in fit.floor_error]


def _line(points: MarkedPoints, fit: PointFit, unit: str) -> str:
    count = len(points.image)
    if count == 4:  # noqa: PLR2004 — the minimum for a homography
        return f"{points.camera}: 4 pairs always fit exactly; a fifth would show errors"
    worst = int(np.argmax(fit.image_error))
    return (
        f"{points.camera}: {count} pairs, off by {np.median(fit.floor_error):.3g} {unit} (median), "
        f"{fit.floor_error.max():.3g} {unit} (most), in the picture {np.median(fit.image_error):.1f} and "
        f"{fit.image_error[worst]:.1f} pixels; the worst is pair {worst + 1}"
    )
