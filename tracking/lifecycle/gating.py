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

Bools = npt.NDArray[np.bool_]


def gate_detections(
    objects: Sequence[TrackedObject],
    first: int,
    frames: Sequence[Detections],
    window: ResolvedWindowSettings,
) -> Bools:
    """Return which detections of each frame of a window each object can be, `(n, M, K)`; padding is False.

    `first` is the number of the window's first frame.
    """
    counts = [len(detections) for detections in frames]
    present = np.arange(max(counts)) < np.array(counts)[:, None]
    allowed = np.zeros((len(objects), *present.shape), dtype=np.bool_)
    boxes = np.concatenate([detections.boxes for detections in frames])
    numbers = np.repeat(first + np.arange(len(frames)), counts)
    for n, item in enumerate(objects):
        allowed[n, present] = within_gate(item.box, boxes, np.abs(numbers - item.frame), window)
    return allowed


def within_gate(
    box: Floats, boxes: Floats, elapsed: npt.NDArray[np.int64], window: ResolvedWindowSettings
) -> Bools:
    """Return which boxes `(K, 4)` an object of `box` `(4,)` can have reached after `elapsed` frames, `(K,)`.

    In t seconds it may have moved by `gate_heights + gate_speed t` heights (`distance_in_heights`), and its
    height may have changed by `max_height_ratio`.
    """
    height, other_heights = float(heights(box)), heights(boxes)
    max_distance = window.gate_heights + window.gate_speed * np.maximum(elapsed, 1) / window.fps
    similar = (other_heights <= window.max_height_ratio * max(height, 1.0)) & (
        height <= window.max_height_ratio * np.maximum(other_heights, 1.0)
    )
    return np.asarray(
        (distance_in_heights(box, boxes) <= max_distance) & (similar | (elapsed > window.window))
    )


def restrict_network(network: Network, allowed: Bools) -> Network:
    """Return the network without the gated places; `allowed` is `(n, M, K)`."""
    node = network.node.copy()
    node[:, :, :-1][~allowed] = np.inf
    return replace(network, node=node)
