"""Marked points of a camera, and the detection of points that contradict the others."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.homography import MIN_POINTS, Floats, apply_homography, fit_homography

_MIN_POINTS_TO_NAME = 6
"""Pairs needed to identify wrong ones: of five pairs any four can be fitted exactly."""
_MOST_TRIALS = 500
"""Quadruples tried; up to eleven pairs have fewer."""
_SEED = 1


class CalibrationError(ValueError):
    """No calibration is possible. The message is one line: why, and what would help."""


@dataclass(frozen=True, slots=True)
class PointSettings:
    """When marked points contradict each other.

    Raises:
        ValueError: a setting is out of range.
    """

    # Allowed error of a pair in the picture, as a share of the diagonal of the points' bounding box.
    tolerance: float = 0.02
    # Largest share of pairs that is reported as wrong; with more, all pairs are in doubt.
    maximum_inconsistent_share: float = 0.34

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.tolerance < 1 or not 0 <= self.maximum_inconsistent_share < 1:
            raise ValueError(
                "point settings: tolerance and maximum_inconsistent_share are shares, above 0 and below 1"
            )


@dataclass(frozen=True, slots=True)
class MarkedPoints:
    """The marked pairs of one camera.

    Attributes:
        camera: its name, for messages.
        image: (N, 2) pixels of the camera's own picture.
        floor: (N, 2) the same places on the floor, in the user's unit.
        names: what messages call the N pairs; empty: by their numbers, from 1.
    """

    camera: str
    image: Floats
    floor: Floats
    names: tuple[str, ...] = ()

    def label(self, pair: int) -> str:
        """Return what messages call a pair."""
        return self.names[pair] if self.names else f"pair {pair + 1}"


def image_errors(backwards: Floats, points: MarkedPoints) -> Floats:
    """Compute the distance of each floor point from its image, (N,); infinite: beyond the horizon."""
    off = apply_homography(backwards, points.floor) - points.image
    return np.asarray(np.nan_to_num(np.hypot(*off.T), nan=np.inf))


def describe_inconsistency(
    points: MarkedPoints, errors: Floats, allowed: float, settings: PointSettings
) -> str:
    """Return an error message that names the inconsistent pairs, if they can be identified."""
    count = len(points.image)
    fits = _consensus(points, allowed) if count >= _MIN_POINTS_TO_NAME else np.ones(count, dtype=bool)
    wrong = np.flatnonzero(~fits).tolist()
    if not 0 < len(wrong) <= settings.maximum_inconsistent_share * count or count - len(wrong) <= MIN_POINTS:
        return (
            f"camera {points.camera}: the pairs contradict each other, by up to {errors.max():.0f} pixels; "
            f"check them all, or add more ({_MIN_POINTS_TO_NAME} at least), to find the wrong ones"
        )
    backwards = fit_homography(points.floor[fits], points.image[fits])
    off = image_errors(backwards, points)
    places = (
        f"image {_point_text(points.image[pair])}, floor {_point_text(points.floor[pair])}" for pair in wrong
    )
    named = ", ".join(f"{points.label(pair)} ({place})" for pair, place in zip(wrong, places, strict=True))
    one = len(wrong) == 1
    far = f"{off[wrong].min():.0f} pixels" if np.isfinite(off[wrong]).all() else "beyond the horizon"
    return (
        f"camera {points.camera}: {named} {'contradicts' if one else 'contradict'} the others: {far} off, "
        f"where the others are within "
        f"{off[fits].max():.1f}; correct or remove {'it' if one else 'them'}"
    )


def _consensus(points: MarkedPoints, allowed: float) -> NDArray[np.bool_]:
    """Return which pairs agree with the best homography through four of them: (N,) bool."""
    count = len(points.image)
    best, best_score = np.ones(count, dtype=bool), (0, 0.0)
    for four in _point_quadruples(count):
        try:
            errors = image_errors(fit_homography(points.floor[four], points.image[four]), points)
        except (ValueError, np.linalg.LinAlgError):
            continue
        near = errors <= allowed
        score = (int(near.sum()), -float(errors[near].sum()))
        if score > best_score:
            best, best_score = near, score
    return np.asarray(best)


def _point_quadruples(count: int) -> list[list[int]]:
    """Return all quadruples of so many points, or a random sample of them."""
    if comb(count, MIN_POINTS) <= _MOST_TRIALS:
        return [list(four) for four in combinations(range(count), MIN_POINTS)]
    random = np.random.default_rng(_SEED)
    return [random.choice(count, MIN_POINTS, replace=False).tolist() for _ in range(_MOST_TRIALS)]


def _point_text(point: Floats) -> str:
    return f"{point[0]:g} {point[1]:g}"
