"""An operator's corrections as costs of network nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.interactive.settings import InteractiveSettings
from tracking.model.network import Network


@dataclass(frozen=True, slots=True)
class PositionCorrection:
    """An operator's statement: in this frame this object is at this pixel.

    Attributes:
        frame: the frame number.
        object: the track's id.
        x: pixels from the left.
        y: pixels from the top.
        tolerance: typical error of the correction, in pixels.

    Raises:
        ValueError: the tolerance is not positive, or a number is not finite.
    """

    frame: int
    object: int
    x: float
    y: float
    tolerance: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.x, self.y, self.tolerance]).all() and self.tolerance > 0.0):
            raise ValueError(f"a correction needs finite coordinates and a positive tolerance, not {self}")


def normalized_squared_distance(correction: PositionCorrection, boxes: Floats) -> Floats:
    """Return the normalized squared distance of boxes `(..., 4)` from a correction, `(...)` in [0, 1].

    The squared distance of the point from the center of the box, in units of twice the tolerance, at most
    1. For normally distributed pointing errors it is a log-likelihood, up to a factor.
    """
    centers = (boxes[..., :2] + boxes[..., 2:]) / 2.0
    squared = ((centers - [correction.x, correction.y]) ** 2).sum(axis=-1) / (2.0 * correction.tolerance) ** 2
    return np.asarray(np.minimum(squared, 1.0))


def near_correction(correction: PositionCorrection, boxes: Floats) -> NDArray[np.bool_]:
    """Return which boxes `(K, 4)` are close enough to be the corrected object, `(K,)`."""
    return np.asarray(normalized_squared_distance(correction, boxes) < 1.0)


def apply_corrections(
    network: Network,
    first: int,
    ids: Sequence[int],
    corrections: Mapping[int, Mapping[int, PositionCorrection]],
    settings: InteractiveSettings,
    reappearance_cost: float,
) -> Network:
    """Return the network of a window with the corrections' costs added to its nodes.

    With `far` the `normalized_squared_distance`, being at node v costs the corrected object
    `correction_weight far(v)` more, and being occluded costs it `correction_weight hidden_share` more: an
    operator who points at an occluded object points closer to its true position than to the center of the
    object in front. Other objects have no extra cost, since conflicts keep them off the place. The corrected
    object may reappear anywhere near the point: arcs out of the occlusion node that were gated away get the
    cost `reappearance_cost`.

    Args:
        network: objects `ids`, which share their observations.
        first: the window's first frame.
        ids: the tracks, in the order of the network's objects.
        corrections: corrections by frame and object.
        settings: the weights.
        reappearance_cost: cost of the most expensive way out of an occlusion.
    """
    frames = [m for m in range(network.frames) if first + m in corrections]
    if not frames:
        return network
    node, source, pair = network.node.copy(), network.source.copy(), network.pair.copy()
    owners = np.asarray(ids)
    for m in frames:
        for correction in corrections[first + m].values():
            own = np.flatnonzero(owners == correction.object)
            if not len(own):
                continue
            far = normalized_squared_distance(correction, network.boxes[0, m])
            node[own, m, :-1] += settings.correction_weight * far
            node[own, m, -1] += settings.correction_weight * settings.hidden_share
            arcs = source[own[0]] if m == 0 else pair[network.pair_sets[own[0]], m - 1, -1]
            arcs[:-1][(far < 1.0) & np.isinf(arcs[:-1])] = reappearance_cost
    return replace(network, node=node, source=source, pair=pair)
