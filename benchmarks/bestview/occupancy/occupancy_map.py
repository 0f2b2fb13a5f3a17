"""A probabilistic occupancy map of the ground in one frame, from all cameras' foreground.

Fleuret, Berclaz, Lengagne and Fua, "Multicamera people tracking with a probabilistic occupancy map", IEEE
PAMI 2008, section 5 and appendix, whose symbols are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

Plane = NDArray[np.float64]
_MIN_PROBABILITY = 1e-6
"""Distance of probabilities from 0 and 1, so that the iteration can still change them."""


@dataclass(frozen=True, slots=True)
class OccupancySettings:
    """The model of the pictures, and the iteration.

    Attributes:
        prior: epsilon, the prior probability of a person at a place.
        sigma: typical distance of the foreground from the rectangles, as a share of their area.
        least_area: lower bound of the area of all rectangles, in mean rectangles. The paper has no such
            bound; without it a little noise in an empty picture has the largest distance possible.
        step: damping: the share of each iteration's answer that is applied.
        iterations: at most.
        settled: largest change of a probability at which the iteration stops.
    """

    prior: float = 0.01
    sigma: float = 0.005
    least_area: float = 0.2
    step: float = 0.3
    iterations: int = 100
    settled: float = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ForegroundObservation:
    """The foreground of one camera in one frame.

    Attributes:
        foreground: B, (H, W), the share of foreground in each cell.
        weight: (H, W) of each cell.
    """

    foreground: Plane
    weight: Plane


class OccupancyMap:
    """Computes the probability of a person at each of L places."""

    def __init__(self, rectangles: Sequence[NDArray[np.int64]], settings: OccupancySettings) -> None:
        """Build a map for fixed rectangles.

        Args:
            rectangles: of each camera, (L, 4) left, top, right, bottom in cells of its picture, inside of it;
                without area where it does not see the place.
            settings: the model.
        """
        self._settings = settings
        self._rectangles = rectangles

    def compute(self, observations: Sequence[ForegroundObservation]) -> Floats:
        """Return the probabilities (L,), the fixed point of the paper's mean field (its equation 15).

        With A_c the picture of the rectangles of all present people, expected under q, and B_c the
        foreground, `q_i = 1 / (1 + exp(log((1 - prior) / prior) + sum_c Psi(B_c, E[A_c | X_i = 1]) - Psi(B_c,
        E[A_c | X_i = 0])))`, where `Psi(B, A) = |B (1 - A) + (1 - B) A| / (sigma |A|)`.
        """
        settings = self._settings
        cameras = [
            _Camera(rectangles, observation, settings.least_area)
            for rectangles, observation in zip(self._rectangles, observations, strict=True)
        ]
        before = np.log((1.0 - settings.prior) / settings.prior)
        q = np.full(len(self._rectangles[0]), settings.prior)
        for _ in range(settings.iterations):
            energy_difference = sum(camera.energy_difference(q) for camera in cameras) / settings.sigma
            answer = 1.0 / (1.0 + np.exp(np.clip(before + energy_difference, -500.0, 500.0)))
            change = settings.step * (np.clip(answer, _MIN_PROBABILITY, 1.0 - _MIN_PROBABILITY) - q)
            q = q + change
            if np.abs(change).max(initial=0.0) < settings.settled:
                break
        return q


class _Camera:
    """One camera's foreground and rectangles."""

    def __init__(
        self, rectangles: NDArray[np.int64], observation: ForegroundObservation, least_area: float
    ) -> None:
        self._shape = observation.weight.shape
        left, top, right, bottom = rectangles.T
        wide = self._shape[1] + 1
        corners = np.stack(
            [top * wide + left, top * wide + right, bottom * wide + left, bottom * wide + right]
        )
        self._visible = np.flatnonzero((right > left) & (bottom > top))
        self._corners = corners[:, self._visible]
        self._places = len(rectangles)
        self._weight = observation.weight
        self._foreground = observation.weight * observation.foreground
        areas = self._inside(observation.weight)
        self._least = max(least_area * float(areas.mean()) if areas.size else 0.0, 1.0)
        self._all = float(observation.weight.sum())
        self._foreground_area = float(self._foreground.sum())

    def energy_difference(self, q: Floats) -> Floats:
        """Return `sigma (Psi(B, E[A | X_i = 1]) - Psi(B, E[A | X_i = 0]))` for every place, (L,)."""
        q = q[self._visible]
        # 1 - E[A], the probability that no person covers a cell, and the share of B left unexplained.
        uncovered = self._uncovered(q)
        empty, unexplained = uncovered * self._weight, uncovered * self._foreground
        area = self._all - float(empty.sum())
        distance = self._foreground_area + area - 2.0 * (self._foreground_area - float(unexplained.sum()))
        # The change of area and distance if a rectangle is certainly covered.
        added_area, added_distance = self._inside(empty), self._inside(empty - 2.0 * unexplained)
        odds = q / (1.0 - q)
        occupied_distance = (distance + added_distance) / np.maximum(area + added_area, self._least)
        empty_distance = (distance - odds * added_distance) / np.maximum(
            area - odds * added_area, self._least
        )
        result = np.zeros(self._places)
        result[self._visible] = occupied_distance - empty_distance
        return result

    def _uncovered(self, q: Floats) -> Plane:
        """Return the product of `1 - q_k` over the rectangles on each cell, by sums of logarithms."""
        value = np.log1p(-q)
        height, width = self._shape
        weights = np.concatenate([value, -value, -value, value])
        flat = np.bincount(self._corners.ravel(), weights, minlength=(height + 1) * (width + 1))
        # The sums of the corners, row and column, are the sums of the rectangles.
        sums = cv2.integral(flat.reshape(height + 1, width + 1)[:height, :width], sdepth=cv2.CV_64F)
        return np.asarray(np.exp(np.minimum(sums[1:, 1:], 0.0)))

    def _inside(self, plane: Plane) -> Floats:
        """Return the plane's sum over each visible rectangle."""
        sums = cv2.integral(plane, sdepth=cv2.CV_64F).ravel()
        one, two, three, four = self._corners
        return np.asarray(sums[one] - sums[two] - sums[three] + sums[four])
