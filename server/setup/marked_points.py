"""A site's calibration from marked points: compared with the present one, written into the configuration."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bestview.calibration import CalibrationError, MarkedPoints
from server.config.ground_unit import check_unit_spelling
from server.config.loader import load_config
from server.service.calibration.plan_worker import draw_floor_plan
from server.service.calibration.point_report import UNNAMED, PointReport, PresentGround, calibrate_points
from server.service.calibration.points_file import parse_points
from server.setup.ground import AppliedGround, apply_ground, read_ground
from server.system.errors import UserError

_POINTS_MAX = 1000
"""Points of one camera."""


@dataclass(frozen=True, slots=True)
class PresentCalibration:
    """The calibration that the configuration file names.

    Attributes:
        cameras: of the site.
        ground: the homographies of those cameras.
        points: the marked points that they were computed from, as in a file of points; empty: from none.
        digest: tells whether it has changed.
    """

    cameras: Collection[str]
    ground: PresentGround = field(default_factory=PresentGround)
    points: Mapping[str, Any] = field(default_factory=dict)
    digest: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class PointCalibration:
    """A calibration from marked points, in a unit of the floor."""

    unit: str
    report: PointReport


def present_calibration(path: Path) -> PresentCalibration:
    """Return the calibration that a configuration file names.

    Raises:
        UserError: the configuration or the ground file is invalid.
    """
    cameras = load_config(path).camera_ids
    file = read_ground(path)
    if file is None:
        return PresentCalibration(cameras)
    content = file.content
    homographies = {
        name: np.array(matrix, dtype=np.float64)
        for name, matrix in content["homography"].items()
        if name in cameras
    }
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    present = PresentGround(content.get("unit"), homographies)
    return PresentCalibration(cameras, present, _readable_points(content, cameras), digest)


def calibrate_from_points(
    content: Mapping[str, Any],
    present: PresentCalibration,
    sizes: Mapping[str, tuple[int, int]] | None = None,
) -> PointCalibration:
    """Calibrate from the content of a file of marked points.

    Args:
        content: the file's content.
        present: the calibration that it would replace.
        sizes: width and height of cameras' pictures, as far as they are known.

    Raises:
        UserError: it is invalid, names a camera that the site does not have, or its points contradict each
            other.
    """
    points = parse_points(content, "the points")
    try:
        unit = check_unit_spelling(points.unit or UNNAMED)
    except ValueError as error:
        raise UserError(f"unit: {error}") from error
    for camera in points.cameras:
        if camera.camera not in present.cameras:
            raise UserError(
                f"the configuration has no camera {camera.camera!a} (any more): remove its points"
            )
        if len(camera.image) > _POINTS_MAX:
            raise UserError(f"camera {camera.camera}: has more than {_POINTS_MAX} points")
        _check_in_picture(camera, (sizes or {}).get(camera.camera))
    try:
        return PointCalibration(unit, calibrate_points(points, unit, present.ground))
    except CalibrationError as error:
        raise UserError(str(error)) from error


async def draw_plan(calibration: PointCalibration) -> bytes:
    """Return the floor plan of a calibration as PNG; empty if it cannot be drawn."""
    return await draw_floor_plan(calibration.report.views, calibration.unit)


def apply_points(path: Path, content: Mapping[str, Any], digest: str) -> AppliedGround:
    """Calibrate from marked points, and write the result into a configuration; earlier files are kept.

    Raises:
        UserError: as :func:`calibrate_from_points`; the present calibration is not the one of this digest any
            more; or as :func:`apply_ground`.
    """
    present = present_calibration(path)
    if present.digest != digest:
        raise UserError("the calibration in the configuration was changed meanwhile: calibrate again")
    return apply_ground(path, calibrate_from_points(content, present).report.ground)


def _check_in_picture(points: MarkedPoints, size: tuple[int, int] | None) -> None:
    if size is None:
        return
    outside = ((points.image < 0) | (points.image > size)).any(axis=1)
    if outside.any():
        pair = int(np.flatnonzero(outside)[0])
        x, y = points.image[pair]
        raise UserError(
            f"camera {points.camera}: {points.label(pair)}: {x:g}, {y:g} is outside its picture, "
            f"{size[0]}x{size[1]} pixels"
        )


def _readable_points(content: Mapping[str, Any], cameras: Collection[str]) -> Mapping[str, Any]:
    """Return the marked points in a ground file of some cameras; nothing if they are not such."""
    points = content.get("points")
    if not isinstance(points, dict):
        return {}
    known = {name: pairs for name, pairs in points.items() if name in cameras}
    try:
        parse_points({"cameras": known}, "points")
    except UserError:
        return {}
    return known
