"""Inserted hypotheses: candidates for corrected objects that the detector missed.

Where a detector merges two bodies or misses one, the corrected object has no observation. One is inserted
that only this object can use and that conflicts with no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, areas
from tracking.interactive.corrections import PositionCorrection, near_correction
from tracking.model.network import Network
from tracking.types import Detections

_MAX_AREA_RATIO = 1.6
"""Largest ratio of a box's area to the object's; two bodies side by side have more."""

InsertedHypotheses = Mapping[int, Mapping[int, int]]
"""By frame and object, the index of the observation inserted for it."""


def box_around(correction: PositionCorrection, size: Floats) -> Floats:
    """Return the box `(4,)` of `size` `(2,)` (width, height) centered at the corrected point."""
    center = np.array([correction.x, correction.y])
    return np.concatenate([center - size / 2.0, center + size / 2.0])


def has_hypothesis(correction: PositionCorrection, size: Floats, boxes: Floats) -> bool:
    """Return whether any of the boxes `(K, 4)` is near the point and of about that size."""
    ratio = areas(boxes) / max(float(size[0] * size[1]), 1.0)
    return bool(
        (
            near_correction(correction, boxes) & (ratio < _MAX_AREA_RATIO) & (ratio > 1.0 / _MAX_AREA_RATIO)
        ).any()
    )


def insert_hypothesis(detections: Detections, box: Floats, histogram: Floats) -> Detections:
    """Append a hypothesis for a corrected object, of score 0 so that no new track starts from it."""
    return Detections(
        np.concatenate([detections.boxes, box[None]]),
        np.append(detections.scores, 0.0),
        np.concatenate([detections.histograms, histogram[None, : detections.histograms.shape[1]]]),
    )


def apply_insertions(
    network: Network, first: int, ids: Sequence[int], inserted: InsertedHypotheses, change: float
) -> Network:
    """Return the network of a window in which inserted hypotheses belong to their object only.

    Other objects cannot use them, and they conflict with nothing. Moving by less than a body to or from one
    costs at most `change`: pointing is less exact than detection.
    """
    frames = [m for m in range(network.frames) if inserted.get(first + m)]
    if not frames:
        return network
    node, source, pair = network.node.copy(), network.source.copy(), network.pair.copy()
    conflicts, owners = network.conflicts.copy(), np.asarray(ids)
    for m in frames:
        for number, k in inserted[first + m].items():
            node[owners != number, m, k] = np.inf
            conflicts[m, k] = conflicts[m, :, k] = False
            conflicts[m, k, k] = True
            box = network.boxes[0, m, k]
            if m == 0:
                source[owners == number, k] = np.minimum(source[owners == number, k], change)
            else:
                near = _near(box, network.boxes[0, m - 1])
                arcs = pair[:, m - 1, :-1, k]
                arcs[:, near] = np.minimum(arcs[:, near], change)
            if m < network.frames - 1:
                near = _near(box, network.boxes[0, m + 1])
                arcs = pair[:, m, k, :-1]
                arcs[:, near] = np.minimum(arcs[:, near], change)
    return replace(network, node=node, source=source, pair=pair, conflicts=conflicts)


def _near(box: Floats, boxes: Floats) -> NDArray[np.bool_]:
    """Return which boxes `(K, 4)` are within one body size of a box, `(K,)`."""
    center, centers = (box[:2] + box[2:]) / 2.0, (boxes[:, :2] + boxes[:, 2:]) / 2.0
    return np.asarray(((centers - center) ** 2).sum(axis=1) <= areas(box))
