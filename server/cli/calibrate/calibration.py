"""``myview calibrate``: homographies of cameras from marked points or walks, with their errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bestview.calibration import CalibrationError, WalkSettings
from server.config.ground_unit import check_unit_spelling
from server.service.calibration import point_report
from server.service.calibration.calibration_report import RecordedWalk, calibrate_walk
from server.service.calibration.floor_plan import plot_floor_plan
from server.service.calibration.floor_plan_camera import floor_plan_cameras
from server.service.calibration.point_report import UNNAMED
from server.service.calibration.points_file import read_points
from server.system.errors import UserError


def calibrate_points(points: Path, out: Path, plan: Path, unit: str | None) -> list[str]:
    """Fit homographies to marked points, and write the ground file and the floor plan.

    Returns:
        Lines to print.

    Raises:
        UserError: the file is invalid, or its points contradict each other.
    """
    chosen_unit = None if unit is None else _checked("--unit", unit)
    marked = read_points(points)
    unit = chosen_unit or _checked(f"{points}: unit", marked.unit or UNNAMED)
    with calibration_errors_as_user_errors(points):
        report = point_report.calibrate_points(marked, unit)
    plot_floor_plan(report.views, unit, plan)
    out.write_text(report.ground, encoding="utf-8")
    return list(report.lines)


def calibrate_from_walks(
    walk: RecordedWalk, out: Path, plan: Path, settings: WalkSettings, person_height: float, *, force: bool
) -> list[str]:
    """Calibrate from walks, and write the ground file and the floor plan.

    Returns:
        Lines to print.

    Raises:
        UserError: the walk covered too little.
    """
    with calibration_errors_as_user_errors("calibrate"):
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
def calibration_errors_as_user_errors(source: Path | str) -> Iterator[None]:
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
