"""Somebody points at somebody: what that costs the nodes of its frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.interactive.settings import AssistSettings
from tracking.model.network import Network


@dataclass(frozen=True, slots=True)
class Pointing:
    """At this frame this object is at this pixel.

    Attributes:
        frame: the frame number.
        object: the track's id.
        x: pixels from the left.
        y: pixels from the top.
        reach: how far off the pointing may be, pixels: where it is usually within.

    Raises:
        ValueError: the reach is not positive, or a number is none.
    """

    frame: int
    object: int
    x: float
    y: float
    reach: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.x, self.y, self.reach]).all() and self.reach > 0.0):
            raise ValueError(f"a pointing needs a place and a positive reach, not {self}")


def farness(pointing: Pointing, boxes: Floats) -> Floats:
    """Say how far boxes `(..., 4)` are from what is pointed at, `(...)` in [0, 1].

    The squared distance of the point from the middle of the box, in units of twice the reach, 1 at most:
    where people point with normal errors it is the logarithm of a likelihood, up to a factor; and nobody
    is more than elsewhere, however far.
    """
    middles = (boxes[..., :2] + boxes[..., 2:]) / 2.0
    squared = ((middles - [pointing.x, pointing.y]) ** 2).sum(axis=-1) / (2.0 * pointing.reach) ** 2
    return np.asarray(np.minimum(squared, 1.0))


def pointed_at(pointing: Pointing, boxes: Floats) -> NDArray[np.bool_]:
    """Say which boxes `(K, 4)` may be what is pointed at, `(K,)`."""
    return np.asarray(farness(pointing, boxes) < 1.0)


def with_pointings(
    network: Network,
    first: int,
    ids: Sequence[int],
    pointings: Mapping[int, Mapping[int, Pointing]],
    settings: AssistSettings,
    comeback: float,
) -> Network:
    """Give the network of a window from the frame `first` with what pointings cost added to its nodes.

    With `far` as in `farness`, the place v of the object that is pointed at costs `weight far(v)` more, and
    its being hidden `weight hidden`: who points at somebody who is covered is nearer to their own place
    than to the middle of who covers them. Others need not be charged: one place is for one. Who is pointed
    at comes out of hiding anywhere near: an arc that there is none for costs `comeback`.

    Args:
        network: whose objects are `ids`, all of which share the observations.
        first: its first frame.
        ids: the tracks.
        pointings: by frame and object.
        settings: the weights.
        comeback: what the dearest way out of hiding costs.
    """
    frames = [m for m in range(network.frames) if first + m in pointings]
    if not frames:
        return network
    node, source, pair = network.node.copy(), network.source.copy(), network.pair.copy()
    owners = np.asarray(ids)
    for m in frames:
        for it in pointings[first + m].values():
            own = np.flatnonzero(owners == it.object)
            if not len(own):
                continue
            far = farness(it, network.boxes[0, m])
            node[own, m, :-1] += settings.weight * far
            node[own, m, -1] += settings.weight * settings.hidden
            way = source[own[0]] if m == 0 else pair[network.pair_sets[own[0]], m - 1, -1]
            way[:-1][(far < 1.0) & np.isinf(way[:-1])] = comeback
    return replace(network, node=node, source=source, pair=pair)
