"""``myview calibrate``: a homography per camera, from marked points or from walks, and how far off."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bestview.calibration import CalibrationError, MarkedPoints, PointFit, WalkSettings, fit_cameras
from server.cli.calibrate.points_file import read_points
from server.config.ground_unit import check_unit
from server.service.calibration.calibration_report import RecordedWalk, calibrate_walk, ground_file_text
from server.service.calibration.floor_plan import FloorPlanCamera, floor_plan_cameras, plot_floor_plan
from server.system.errors import UserError

_UNNAMED = "unit"


def calibrate_points(points: Path, out: Path, plan: Path, unit: str | None) -> list[str]:
    """Read the points, fit, and write the file and the plan; return the lines to say.

    Raises:
        UserError: the file is no such file, or its points contradict each other.
    """
    chosen_unit = None if unit is None else _checked("--unit", unit)
    given = read_points(points)
    unit = chosen_unit or _checked(f"{points}: unit", given.unit or _UNNAMED)
    with refusing(points):
        fits = fit_cameras(given.cameras)
    views = [
        FloorPlanCamera(it.camera, fits[it.camera].homography, it.image, it.floor) for it in given.cameras
    ]
    plot_floor_plan(views, unit, plan)
    homographies = {camera: fit.homography for camera, fit in fits.items()}
    residuals = {name: _rounded(fit) for name, fit in fits.items()}
    out.write_text(ground_file_text(unit, homographies, {"residuals": residuals}), encoding="utf-8")
    return [_line(it, fits[it.camera], unit) for it in given.cameras]


def calibrate_from_walks(
    walked: RecordedWalk, out: Path, plan: Path, settings: WalkSettings, person: float, *, force: bool
) -> list[str]:
    """Calibrate from walks, and write the file and the plan; return the lines to print.

    Raises:
        UserError: the walk says too little.
    """
    with refusing("calibrate"):
        outcome = calibrate_walk(walked, settings, person)
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
        return check_unit(unit)
    except ValueError as error:
        raise UserError(f"{where}: {error}") from error


def _rounded(fit: PointFit) -> list[float]:
    return [float(f"{error:.4g}") for error in fit.floor_error]


def _line(points: MarkedPoints, fit: PointFit, unit: str) -> str:
    count = len(points.image)
    if count == 4:  # noqa: PLR2004 — as many as a homography takes
        return f"{points.camera}: 4 pairs always fit exactly; a fifth would show errors"
    worst = int(np.argmax(fit.image_error))
    return (
        f"{points.camera}: {count} pairs, off by {np.median(fit.floor_error):.3g} {unit} (median), "
        f"{fit.floor_error.max():.3g} {unit} (most), in the picture {np.median(fit.image_error):.1f} and "
        f"{fit.image_error[worst]:.1f} pixels; the worst is pair {worst + 1}"
    )
