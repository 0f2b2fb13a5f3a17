"""Homography of a camera from marked points: a place in the picture and the same place on the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestview.calibration.homography import MIN_POINTS, Floats, fit_homography
from bestview.calibration.marked_points import (
    CalibrationError,
    MarkedPoints,
    PointSettings,
    describe_inconsistency,
    image_errors,
)
from bestview.geometry.ground_plane import to_ground, validate_homography


@dataclass(frozen=True, slots=True)
class PointFit:
    """A camera's homography, and its errors at the marked points.

    Attributes:
        homography: image to floor, (3, 3).
        floor_error: distance on the floor, (N,), in the floor's unit.
        image_error: distance in the picture, (N,), pixels.
    """

    homography: Floats
    floor_error: Floats
    image_error: Floats


def fit_points(points: MarkedPoints, settings: PointSettings | None = None) -> PointFit:
    """Fit the homography of a camera to its marked points by least squares in the picture.

    Raises:
        CalibrationError: too few pairs, pairs on a line, pairs that contradict each other, or pairs above
            the horizon.
    """
    settings = settings or PointSettings()
    _check(points)
    backwards = _fit(points.floor, points.image, points.camera)
    allowed = settings.tolerance * _extent(points.image)
    errors = image_errors(backwards, points)
    if errors.max() > allowed:
        raise CalibrationError(describe_inconsistency(points, errors, allowed, settings))
    homography = _inverse(backwards, points.camera)
    if _first_above_horizon(homography, points) is not None:
        # From straight above, errors of the points decide on which side of the picture the far horizon is.
        backwards = _fit_affine(points.floor, points.image)
        if image_errors(backwards, points).max() <= allowed:
            errors, homography = image_errors(backwards, points), _inverse(backwards, points.camera)
    above = _first_above_horizon(homography, points)
    if above is not None:
        raise CalibrationError(
            f"camera {points.camera}: {points.label(above)} would be above the horizon; the points go round "
            "in another order on the floor than in the picture, or the picture is upside down"
        )
    floor = to_ground(homography, points.image)
    return PointFit(homography, np.hypot(*(floor - points.floor).T), errors)


def fit_cameras(
    cameras: Sequence[MarkedPoints], settings: PointSettings | None = None
) -> dict[str, PointFit]:
    """Fit all cameras, which must see one floor from above.

    Raises:
        CalibrationError: as `fit_points`; or one camera's floor is mirrored against the others'.
    """
    fits = {points.camera: fit_points(points, settings) for points in cameras}
    mirrored = [points.camera for points in cameras if is_mirrored(fits[points.camera], points)]
    if 0 < len(mirrored) < len(cameras):
        others = [points.camera for points in cameras if points.camera not in mirrored]
        few, many = sorted((mirrored, others), key=len)
        raise CalibrationError(
            f"camera {few[0]}: its floor is mirrored against that of {many[0]}: going round clockwise on the "
            "floor must be the same way round in all cameras; are its floor's two coordinates exchanged?"
        )
    return fits


def agrees_with(homography: Floats, points: MarkedPoints, settings: PointSettings | None = None) -> bool:
    """Return whether most marked pairs fit a homography, image to floor, of the same camera.

    At least four pairs do not fit one by chance: then both are in the same coordinates of the floor.
    """
    settings = settings or PointSettings()
    if len(points.image) < MIN_POINTS:
        return False
    errors = image_errors(np.asarray(np.linalg.inv(homography)), points)
    return bool(np.median(errors) <= settings.tolerance * _extent(points.image))


def is_mirrored(fit: PointFit, points: MarkedPoints) -> bool:
    """Return whether clockwise in the picture is anticlockwise on the floor at the points."""
    middle = points.image.mean(axis=0)
    corners = to_ground(fit.homography, middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    across, down = corners[1] - corners[0], corners[2] - corners[0]
    return bool(across[0] * down[1] - across[1] * down[0] < 0)


def _check(points: MarkedPoints) -> None:
    count = len(points.image)
    if count < MIN_POINTS:
        pairs = "pair" if count == 1 else "pairs"
        raise CalibrationError(f"camera {points.camera}: {count} {pairs}; at least {MIN_POINTS} are needed")
    for place, words in ((points.image, "in the picture"), (points.floor, "on the floor")):
        if not np.isfinite(place).all():
            raise CalibrationError(f"camera {points.camera}: a point {words} is not a finite number")
    image, floor = (list(map(tuple, side.tolist())) for side in (points.image, points.floor))
    for source, target, words in (
        (image, floor, "in the picture and two on the floor"),
        (floor, image, "on the floor and two in the picture"),
    ):
        first_index: dict[tuple[float, ...], int] = {}
        for second, point in enumerate(source):
            first = first_index.setdefault(point, second)
            if target[first] != target[second]:
                both = f"{points.label(first)} and {points.label(second)}"
                raise CalibrationError(f"camera {points.camera}: {both} are one point {words}")


def _fit(source: Floats, target: Floats, camera: str) -> Floats:
    try:
        return fit_homography(source, target)
    except (ValueError, np.linalg.LinAlgError):
        raise CalibrationError(_on_a_line(camera)) from None


def _fit_affine(source: Floats, target: Floats) -> Floats:
    """Return the homography without a horizon that maps source to target with least squared error."""
    ones = np.column_stack([source, np.ones(len(source))])
    upper = np.linalg.lstsq(ones, target, rcond=None)[0].T
    return np.vstack([upper, [0.0, 0.0, 1.0]])


def _inverse(backwards: Floats, camera: str) -> Floats:
    try:
        homography = validate_homography(np.linalg.inv(backwards), f"camera {camera}")
    except (ValueError, np.linalg.LinAlgError):
        raise CalibrationError(_on_a_line(camera)) from None
    return np.asarray(homography / np.abs(homography).max())


def _first_above_horizon(homography: Floats, points: MarkedPoints) -> int | None:
    """Return the first pair that is above the horizon in the picture; None: there is none."""
    above = ~np.isfinite(to_ground(homography, points.image)).all(axis=1)
    return int(np.flatnonzero(above)[0]) if above.any() else None


def _on_a_line(camera: str) -> str:
    return f"camera {camera}: the points, or all but one of them, are on a line; mark some beside it"


def _extent(image: Floats) -> float:
    """Return the diagonal of the points' bounding box."""
    return float(np.hypot(*np.ptp(image, axis=0)))
