"""The paper's layout term in heights of people, so that it weighs near and far people alike."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tracking import OnlineTracker
from tracking.boxes import Floats, heights
from tracking.model.network import Network

_LEAST_BOXES = 50
"""Boxes from which heights are fitted to places; before, all are taken to be equally high."""

_LEAST_HEIGHT = 0.2
"""Least fitted height, as a share of the mean."""


class HeightFit:
    """How high people appear whose feet are at a row of the picture: a line, fitted to all boxes so far.

    Heights grow in proportion to the distance below the horizon, and with them what a step on the ground
    measures in the picture.
    """

    def __init__(self) -> None:
        self._sums = np.zeros((2, 2))
        self._products = np.zeros(2)

    def add(self, boxes: Floats) -> None:
        """Add boxes `(B, 4)`."""
        rows = np.stack([np.ones(len(boxes)), boxes[:, 3]])
        self._sums += rows @ rows.T
        self._products += rows @ heights(boxes)

    def places(self, boxes: Floats) -> Floats:
        """Return how far right and how near boxes `(..., 4)` are on the ground, `(..., 2)`, in heights."""
        mean = float(self._products[0] / max(self._sums[0, 0], 1.0))
        slope = 0.0
        if self._sums[0, 0] >= _LEAST_BOXES:
            start, slope = np.linalg.lstsq(self._sums, self._products, rcond=None)[0].tolist()
        if slope <= 0.0:
            return np.stack([boxes[..., [0, 2]].mean(axis=-1), boxes[..., 3]], axis=-1) / max(mean, 1.0)
        fitted = np.maximum(start + slope * boxes[..., 3], max(_LEAST_HEIGHT * mean, 1.0))
        return np.stack([boxes[..., [0, 2]].mean(axis=-1) / fitted, np.log(fitted) / slope], axis=-1)


class GroundLayoutTracker(OnlineTracker):
    """The online tracker with the layout term of all pairs, each movement in heights of who moves."""

    def __init__(self, *settings: Any, weight: float, **more: Any) -> None:
        """Create a tracker; `weight` is the cost of a movement by a height, for each pair of objects."""
        super().__init__(*settings, **more)
        self._weight, self._fit = weight, HeightFit()

    def _adjust_costs(self, network: Network, first: int, ids: list[int]) -> Network:  # noqa: ARG002
        present = network.present
        boxes = network.boxes[present]
        self._fit.add(boxes)
        unit = float(np.median(heights(boxes)))
        found = self._fit.places(boxes) * unit
        places = np.zeros((*network.locations.shape[:3], 2))
        places[:] = found.mean(axis=0)
        places[:, :, :-1][present] = found
        # Two sides of a box stand for an axis.
        return replace(network, locations=np.tile(places, 2), layout=self._weight / (2.0 * unit))
