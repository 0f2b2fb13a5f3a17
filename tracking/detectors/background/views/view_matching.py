"""How a camera was turned: the homography from its former view to the present one.

Whatever a camera shows, a turn about its center moves the picture by a homography. It is found from SIFT
features (Lowe, 2004) that both pictures show, by MAGSAC++ (Barath et al., 2020).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.detectors.base import Image

_FEATURES, _CONTRAST = 1000, 0.02
# Distance to the best match, as a share of that to the second best, up to which a match is clear.
_CLEAR = 0.8
# Pixels that a feature of the scene may be off, at 360 columns.
_OFF = 2.0
_TRIES, _CONFIDENCE = 5000, 0.9999
# Fewest matches that agree, their least share of all, and the least share of the picture that they span.
_MIN_MATCHES, _MIN_SHARE, _MIN_SPAN = 25, 0.35, 0.03
TURNED = 0.1
"""Motion, as a share of the picture's width, from which a camera shows another part of the scene."""
# Least and largest scale of a picture whose camera was turned, and not moved elsewhere.
_MIN_SCALE, _MAX_SCALE = 0.5, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class ViewMatch:
    """Where one view lies in another.

    Attributes:
        homography: (3, 3) from pixels of the one to those of the other.
        matches: number of features that agree.
    """

    homography: Floats
    matches: int

    def after(self, first: Floats) -> ViewMatch:
        """Return the match of a view from which the homography `first` (3, 3) leads to the one."""
        return ViewMatch(self.homography @ first, self.matches)


def find_view(before: Image, after: Image) -> ViewMatch | None:
    """Return where a picture lies in another of the same camera, of the same size.

    None: the pictures have too little in common, or the camera has not only been turned.
    """
    one, two = (_features(image) for image in (before, after))
    if min(len(one[1]), len(two[1])) < _MIN_MATCHES:
        return None
    pairs = cv2.BFMatcher().knnMatch(one[1], two[1], k=2)
    clear = [best for best, second in pairs if best.distance < _CLEAR * second.distance]
    if len(clear) < _MIN_MATCHES:
        return None
    origin = one[0][[match.queryIdx for match in clear]]
    target = two[0][[match.trainIdx for match in clear]]
    tolerance = _OFF * before.shape[1] / 360.0
    matrix, agreeing = cv2.findHomography(
        origin, target, cv2.USAC_MAGSAC, tolerance, maxIters=_TRIES, confidence=_CONFIDENCE
    )
    if matrix is None:
        return None
    kept = agreeing.ravel() > 0
    if np.count_nonzero(kept) < max(_MIN_MATCHES, _MIN_SHARE * len(clear)):
        return None
    hull = cv2.convexHull(target[kept].astype(np.float32))
    height, width = before.shape[:2]
    if cv2.contourArea(hull) < _MIN_SPAN * width * height:
        return None
    # So that what is in front of the camera has a positive depth.
    found = np.asarray(matrix / np.cbrt(np.linalg.det(matrix)), dtype=np.float64)
    return ViewMatch(found, int(kept.sum())) if _is_turn(found, origin[kept]) else None


def shift_of_middle(homography: Floats, image: Image, other: Floats | None = None) -> float:
    """Return how far a homography has the middle of a picture from where another has it, in widths."""
    height, width = image.shape[:2]
    middle = np.array([width / 2.0, height / 2.0, 1.0])
    there = homography @ middle
    here = middle if other is None else other @ middle
    return float(np.linalg.norm(there[:2] / there[2] - here[:2] / here[2]) / width)


def _features(image: Image) -> tuple[Floats, NDArray[np.float32]]:
    """Return the places (N, 2) and descriptors (N, 128) of an image's features."""
    finder = cv2.SIFT.create(_FEATURES, contrastThreshold=_CONTRAST)
    places, descriptors = finder.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), None)
    found = np.array([place.pt for place in places], dtype=np.float64).reshape(-1, 2)
    if descriptors is None:
        return found, np.zeros((0, 128), dtype=np.float32)
    return found, descriptors.astype(np.float32)


def _is_turn(matrix: Floats, places: Floats) -> bool:
    """Return whether a homography neither mirrors nor scales much where the places (N, 2) are."""
    points = np.column_stack([places, np.ones(len(places))])
    depths = points @ matrix[2]
    if not (depths > 0.0).all():
        return False
    # The determinant of the derivative of a homography, which is the scale of areas.
    areas = np.linalg.det(matrix) / depths**3
    return bool((areas > _MIN_SCALE**2).all() and (areas < _MAX_SCALE**2).all())
