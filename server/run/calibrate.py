"""``myview calibrate``: a homography per camera, from marked points or from walks, and how far off."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bestview.calibrate import (
    CalibrationError,
    MarkedPoints,
    PointFit,
    WalkSettings,
    calibrate_walks,
    fit_cameras,
)
from server.run.calibrate_file import write_ground
from server.run.calibrate_plan import PlanView, plan_of, plot_plan
from server.run.calibrate_points import read_points
from server.run.calibrate_tracks import Walked
from server.run.calibrate_words import details, in_words, missed
from server.wire.errors import UserError

_UNNAMED = "unit"


def calibrate_points(points: Path, out: Path, plan: Path, unit: str | None) -> list[str]:
    """Read the points, fit, and write the file and the plan; give the lines to say.

    Raises:
        UserError: the file is no such file, or its points contradict each other.
    """
    given = read_points(points)
    unit = unit or given.unit or _UNNAMED
    with refusing(points):
        fits = fit_cameras(given.cameras)
    views = [PlanView(it.camera, fits[it.camera].homography, it.image, it.floor) for it in given.cameras]
    plot_plan(views, unit, plan)
    homographies = {camera: fit.homography for camera, fit in fits.items()}
    write_ground(out, unit, homographies, {"residuals": {name: _rounded(fit) for name, fit in fits.items()}})
    return [_line(it, fits[it.camera], unit) for it in given.cameras]


def calibrate_from_walks(
    walked: Walked, out: Path, plan: Path, settings: WalkSettings, person: float, *, force: bool
) -> list[str]:
    """Lay the cameras on one floor, and write the file and the plan; give the lines to say.

    Raises:
        UserError: the walk says too little.
    """
    with refusing("calibrate"):
        found = calibrate_walks(walked.walks, settings, person)
    missing = [line for it in found.cameras for line in missed(it)]
    if any(it.serious for it in missing) and not force:
        worst = next(it for it in missing if it.serious)
        raise UserError(
            f"calibrate: the walk covered too little: {worst.words} (--force writes it all the same)"
        )
    plot_plan(plan_of(found), "m", plan)
    homographies = {it.camera: it.homography for it in found.cameras}
    write_ground(out, "m", homographies, details(found, person))
    return [*in_words(walked, found, settings), *(it.words for it in missing)]


@contextmanager
def refusing(source: Path | str) -> Iterator[None]:
    """Say what was given in front of what is wrong with it."""
    try:
        yield
    except CalibrationError as error:
        raise UserError(f"{source}: {error}") from error


def _rounded(fit: PointFit) -> list[float]:
    return [float(f"{error:.4g}") for error in fit.floor_error]


def _line(points: MarkedPoints, fit: PointFit, unit: str) -> str:
    count = len(points.image)
    if count == 4:  # noqa: PLR2004 — as many as a homography takes
        return f"{points.camera}: 4 pairs, which fit exactly whatever they are; a fifth would show errors"
    worst = int(np.argmax(fit.image_error))
    return (
        f"{points.camera}: {count} pairs, off by {np.median(fit.floor_error):.3g} {unit} (median), "
        f"{fit.floor_error.max():.3g} {unit} (most), in the picture {np.median(fit.image_error):.1f} and "
        f"{fit.image_error[worst]:.1f} pixels; the worst is pair {worst + 1}"
    )
