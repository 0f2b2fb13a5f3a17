"""Who stands where in one frame: a probabilistic occupancy map of the ground from all cameras' foreground.

Fleuret, Berclaz, Lengagne and Fua, "Multicamera people tracking with a probabilistic occupancy map", IEEE
PAMI 2008, section 5 and appendix. The symbols are theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

Plane = NDArray[np.float64]
_SUREST = 1e-6
"""No probability is nearer to 0 or 1: what is certain could not be taken back."""


@dataclass(frozen=True, slots=True)
class OccupancySettings:
    """The model of the pictures, and the iteration.

    Attributes:
        prior: epsilon, how likely somebody is at a place before anything was seen.
        sigma: how far the foreground is from rectangles, as a share of these.
        least_area: what the area of all rectangles is never counted less than, in mean rectangles. The paper
            has no such bound; without it a little noise in an empty picture is as far from nobody as can be.
        step: the share of each iteration's answer that is taken over.
        iterations: at most.
        settled: the largest change of a probability with which it ends before.
    """

    prior: float = 0.01
    sigma: float = 0.005
    least_area: float = 0.2
    step: float = 0.3
    iterations: int = 100
    settled: float = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ForegroundObservation:
    """What one camera sees in one frame.

    Attributes:
        foreground: B, (H, W), the share of foreground in each cell.
        weight: (H, W), how much each cell counts.
    """

    foreground: Plane
    weight: Plane


class OccupancyMap:
    """Finds the probabilities that somebody stands at each of L places."""

    def __init__(self, rectangles: Sequence[NDArray[np.int64]], settings: OccupancySettings) -> None:
        """Keep the rectangles.

        Args:
            rectangles: of each camera, (L, 4) left, top, right, bottom in cells of its picture, inside of it;
                without area where it does not see the place.
            settings: the model.
        """
        self._settings = settings
        self._rectangles = rectangles

    def occupied(self, sights: Sequence[ForegroundObservation]) -> Floats:
        """Return the probabilities (L,), the fixed point of the paper's mean field (its equation 15).

        With A_c the picture of all rectangles where somebody is, expected under q, and B_c the foreground,
        `q_i = 1 / (1 + exp(log((1 - prior) / prior) + sum_c Psi(B_c, E[A_c | X_i = 1]) -
        Psi(B_c, E[A_c | X_i = 0])))`, where `Psi(B, A) = |B (1 - A) + (1 - B) A| / (sigma |A|)`.
        """
        settings = self._settings
        cameras = [
            _Camera(rectangles, sight, settings.least_area)
            for rectangles, sight in zip(self._rectangles, sights, strict=True)
        ]
        before = np.log((1.0 - settings.prior) / settings.prior)
        q = np.full(len(self._rectangles[0]), settings.prior)
        for _ in range(settings.iterations):
            farther = sum(camera.farther(q) for camera in cameras) / settings.sigma
            answer = 1.0 / (1.0 + np.exp(np.clip(before + farther, -500.0, 500.0)))
            change = settings.step * (np.clip(answer, _SUREST, 1.0 - _SUREST) - q)
            q = q + change
            if np.abs(change).max(initial=0.0) < settings.settled:
                break
        return q


class _Camera:
    """One camera's foreground beside its rectangles."""

    def __init__(
        self, rectangles: NDArray[np.int64], sight: ForegroundObservation, least_area: float
    ) -> None:
        self._shape = sight.weight.shape
        left, top, right, bottom = rectangles.T
        wide = self._shape[1] + 1
        corners = np.stack(
            [top * wide + left, top * wide + right, bottom * wide + left, bottom * wide + right]
        )
        self._seen = np.flatnonzero((right > left) & (bottom > top))
        self._corners = corners[:, self._seen]
        self._places = len(rectangles)
        self._weight = sight.weight
        self._missed = sight.weight * sight.foreground
        areas = self._inside(sight.weight)
        self._least = max(least_area * float(areas.mean()) if areas.size else 0.0, 1.0)
        self._all = float(sight.weight.sum())
        self._found = float(self._missed.sum())

    def farther(self, q: Floats) -> Floats:
        """Return `sigma (Psi(B, E[A | X_i = 1]) - Psi(B, E[A | X_i = 0]))` for every place, (L,)."""
        q = q[self._seen]
        # 1 - E[A], the probability that nobody covers a cell, and how much of B it leaves unexplained.
        nobody = self._nobody(q)
        empty, missed = nobody * self._weight, nobody * self._missed
        area = self._all - float(empty.sum())
        distance = self._found + area - 2.0 * (self._found - float(missed.sum()))
        # What a cell adds to the area, and to the distance, when it is surely covered instead.
        more, off = self._inside(empty), self._inside(empty - 2.0 * missed)
        odds = q / (1.0 - q)
        there = (distance + off) / np.maximum(area + more, self._least)
        away = (distance - odds * off) / np.maximum(area - odds * more, self._least)
        result = np.zeros(self._places)
        result[self._seen] = there - away
        return result

    def _nobody(self, q: Floats) -> Plane:
        """Return the product of `1 - q_k` over the rectangles on each cell, by sums of logarithms."""
        value = np.log1p(-q)
        height, width = self._shape
        weights = np.concatenate([value, -value, -value, value])
        flat = np.bincount(self._corners.ravel(), weights, minlength=(height + 1) * (width + 1))
        # The sums of the corners, row and column, are the sums of the rectangles.
        sums = cv2.integral(flat.reshape(height + 1, width + 1)[:height, :width], sdepth=cv2.CV_64F)
        return np.asarray(np.exp(np.minimum(sums[1:, 1:], 0.0)))

    def _inside(self, plane: Plane) -> Floats:
        """Return the plane's sum in each rectangle that is seen."""
        sums = cv2.integral(plane, sdepth=cv2.CV_64F).ravel()
        one, two, three, four = self._corners
        return np.asarray(sums[one] - sums[two] - sums[three] + sums[four])
