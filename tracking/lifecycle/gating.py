"""Gating: detections an object cannot have reached are excluded from its network.

Paper II.B allows partially connected networks for this purpose. Without gating an object may reappear
anywhere in the image after an occlusion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, distance_in_heights, heights
from tracking.model.network import Network
from tracking.model.object_state import TrackedObject
from tracking.types import Detections
from tracking.window import ResolvedWindowSettings


def gate_detections(
    item: TrackedObject, frame: int, detections: Detections, window: ResolvedWindowSettings
) -> npt.NDArray[np.bool_]:
    """Return which detections of a frame the object can be, `(K,)` bool."""
    return within_gate(item.box, detections.boxes, abs(frame - item.frame), window)


def within_gate(
    box: Floats, boxes: Floats, elapsed: int, window: ResolvedWindowSettings
) -> npt.NDArray[np.bool_]:
    """Return which boxes `(K, 4)` an object of `box` `(4,)` can have reached after `elapsed` frames, `(K,)`.

    In t seconds it may have moved by `gate_heights + gate_speed t` heights (`distance_in_heights`), and its
    height may have changed by `max_height_ratio`.
    """
    height, other_heights = float(heights(box)), heights(boxes)
    max_distance = window.gate_heights + window.gate_speed * max(elapsed, 1) / window.fps
    similar = (other_heights <= window.max_height_ratio * max(height, 1.0)) & (
        height <= window.max_height_ratio * np.maximum(other_heights, 1.0)
    )
    return np.asarray(
        (distance_in_heights(box, boxes) <= max_distance) & (similar | (elapsed > window.window))
    )


def restrict_network(network: Network, allowed: Sequence[Sequence[npt.NDArray[np.bool_]]]) -> Network:
    """Return the network without the gated places; `allowed[n][m]` is `(K_m,)` bool."""
    node = network.node.copy()
    for n, frames in enumerate(allowed):
        for m, places in enumerate(frames):
            node[n, m, : len(places)][~places] = np.inf
    return replace(network, node=node)
