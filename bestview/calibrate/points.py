"""From marked points, a place in the picture and the same place on the floor, to a homography."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from bestview.calibrate.homography import LEAST_POINTS, Floats, fit_homography, mapped
from bestview.ground import checked_homography, to_ground

_LEAST_TO_BLAME = 6
"""With five pairs any four of them agree: who of them is wrong cannot be told."""
_MOST_TRIALS = 500
"""Fours that are tried; up to eleven pairs have fewer."""
_SEED = 1


class CalibrationError(ValueError):
    """There is no calibration in what was given; the text is one line: why, and what would help."""


@dataclass(frozen=True, slots=True)
class PointSettings:
    """When marked points contradict each other.

    Raises:
        ValueError: a setting outside its range.
    """

    # How far a pair may be off in the picture, as a share of how far the camera's points are spread there.
    tolerance: float = 0.02
    # The most pairs that may be named as wrong, as a share; where more would have to be, all are doubtful.
    wrong: float = 0.34

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.tolerance < 1 or not 0 <= self.wrong < 1:
            raise ValueError("point settings: tolerance and wrong are shares, above 0 and below 1")


@dataclass(frozen=True, slots=True)
class MarkedPoints:
    """The pairs of one camera.

    Attributes:
        camera: its name, for messages.
        image: pixels of the camera's own picture, (N, 2).
        floor: the same places on the floor, (N, 2), in the user's unit.
    """

    camera: str
    image: Floats
    floor: Floats


@dataclass(frozen=True, slots=True)
class PointFit:
    """A camera's homography, and how far it is off at the marked points.

    Attributes:
        homography: image to floor, (3, 3).
        floor_error: distance on the floor, (N,), in the floor's unit.
        image_error: distance in the picture, (N,), pixels.
    """

    homography: Floats
    floor_error: Floats
    image_error: Floats


def fit_points(points: MarkedPoints, settings: PointSettings | None = None) -> PointFit:
    """Fit the homography of a camera to its marked points: least squares in the picture.

    Raises:
        CalibrationError: too few pairs, or on a line; some contradict the others, and are named (from one);
            or the floor would be seen from below the horizon.
    """
    settings = settings or PointSettings()
    _check(points)
    backwards = _fitted(points.floor, points.image, points.camera)
    errors = _distances(backwards, points)
    allowed = settings.tolerance * _spread(points.image)
    if errors.max() > allowed:
        raise CalibrationError(_contradiction(points, errors, allowed, settings))
    try:
        homography = checked_homography(np.linalg.inv(backwards), f"camera {points.camera}")
    except (ValueError, np.linalg.LinAlgError):
        raise CalibrationError(_on_a_line(points.camera)) from None
    homography = homography / np.abs(homography).max()
    floor = to_ground(homography, points.image)
    if not np.isfinite(floor).all():
        pair = int(np.flatnonzero(~np.isfinite(floor).all(axis=1))[0]) + 1
        raise CalibrationError(
            f"camera {points.camera}: pair {pair} would be above the horizon; the points go round in another "
            "order on the floor than in the picture, or the picture is upside down"
        )
    return PointFit(homography, np.hypot(*(floor - points.floor).T), errors)


def fit_cameras(
    cameras: Sequence[MarkedPoints], settings: PointSettings | None = None
) -> dict[str, PointFit]:
    """Fit every camera; they must all see one floor from above.

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


def is_mirrored(fit: PointFit, points: MarkedPoints) -> bool:
    """Say whether going round clockwise in the picture is anticlockwise on the floor at the points."""
    middle = points.image.mean(axis=0)
    corners = to_ground(fit.homography, middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    across, down = corners[1] - corners[0], corners[2] - corners[0]
    return bool(across[0] * down[1] - across[1] * down[0] < 0)


def _check(points: MarkedPoints) -> None:
    count = len(points.image)
    if count < LEAST_POINTS:
        pairs = "pair" if count == 1 else "pairs"
        raise CalibrationError(f"camera {points.camera}: {count} {pairs}; at least {LEAST_POINTS} are needed")
    for place, words in ((points.image, "in the picture"), (points.floor, "on the floor")):
        if not np.isfinite(place).all():
            raise CalibrationError(f"camera {points.camera}: a point {words} is not a finite number")
    for first, second in combinations(range(count), 2):
        same = [bool((it[first] == it[second]).all()) for it in (points.image, points.floor)]
        if same[0] != same[1]:
            raise CalibrationError(
                f"camera {points.camera}: pairs {first + 1} and {second + 1} are one point "
                f"{'in the picture' if same[0] else 'on the floor'} and two "
                f"{'on the floor' if same[0] else 'in the picture'}"
            )


def _fitted(source: Floats, target: Floats, camera: str) -> Floats:
    try:
        return fit_homography(source, target)
    except (ValueError, np.linalg.LinAlgError):
        raise CalibrationError(_on_a_line(camera)) from None


def _on_a_line(camera: str) -> str:
    return f"camera {camera}: the points, or all but one of them, are on a line; mark some beside it"


def _distances(backwards: Floats, points: MarkedPoints) -> Floats:
    """How far each floor point is from its place in the picture, (N,); infinite where it is nowhere."""
    off = mapped(backwards, points.floor) - points.image
    return np.asarray(np.nan_to_num(np.hypot(*off.T), nan=np.inf))


def _spread(image: Floats) -> float:
    """The diagonal of the points' bounding box."""
    return float(np.hypot(*np.ptp(image, axis=0)))


def _contradiction(points: MarkedPoints, errors: Floats, allowed: float, settings: PointSettings) -> str:
    """Say which pairs are wrong, if that can be told."""
    count = len(points.image)
    fits = _largest_agreement(points, allowed) if count >= _LEAST_TO_BLAME else np.ones(count, dtype=bool)
    wrong = np.flatnonzero(~fits)
    if not 0 < len(wrong) <= settings.wrong * count or count - len(wrong) <= LEAST_POINTS:
        return (
            f"camera {points.camera}: the pairs contradict each other, by up to {errors.max():.0f} pixels; "
            f"check them all, or add more ({_LEAST_TO_BLAME} at least), so that the wrong ones can be told"
        )
    backwards = fit_homography(points.floor[fits], points.image[fits])
    off = _distances(backwards, points)
    named = ", ".join(
        f"{number + 1} (image {_place(points.image[number])}, floor {_place(points.floor[number])})"
        for number in wrong
    )
    one = len(wrong) == 1
    far = f"{off[wrong].min():.0f} pixels" if np.isfinite(off[wrong]).all() else "beyond the horizon"
    return (
        f"camera {points.camera}: {'pair' if one else 'pairs'} {named} "
        f"{'contradicts' if one else 'contradict'} the others: {far} off, where the others are within "
        f"{off[fits].max():.1f}; mend or remove {'it' if one else 'them'}"
    )


def _largest_agreement(points: MarkedPoints, allowed: float) -> NDArray[np.bool_]:
    """Give which pairs the best homography through four of them agrees with, (N,)."""
    count = len(points.image)
    best, best_score = np.ones(count, dtype=bool), (0, 0.0)
    for four in _fours(count):
        try:
            errors = _distances(fit_homography(points.floor[four], points.image[four]), points)
        except (ValueError, np.linalg.LinAlgError):
            continue
        near = errors <= allowed
        score = (int(near.sum()), -float(errors[near].sum()))
        if score > best_score:
            best, best_score = near, score
    return np.asarray(best)


def _fours(count: int) -> list[list[int]]:
    """All fours of so many, or some of them where they are too many."""
    if comb(count, LEAST_POINTS) <= _MOST_TRIALS:
        return [list(four) for four in combinations(range(count), LEAST_POINTS)]
    random = np.random.default_rng(_SEED)
    return [random.choice(count, LEAST_POINTS, replace=False).tolist() for _ in range(_MOST_TRIALS)]


def _place(point: Floats) -> str:
    return f"{point[0]:g} {point[1]:g}"
