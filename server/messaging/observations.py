"""A camera's detections as messages carry them: for its peers, and for joint tracking with appearance."""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from server.messaging.number_types import Coordinate, Pulse
from tracking import Detections

ScoredBox = tuple[Coordinate, Coordinate, Coordinate, Coordinate, Annotated[float, msgspec.Meta(ge=0, le=1)]]
"""Left, top, right, bottom in pixels of the camera's image, and the detection score."""

FRAME_DETECTIONS_MAX = 100
"""Detections of one frame, at most; those with the highest scores."""

_HISTOGRAMS_BYTES_MAX = 1 << 18
_SHARE = np.dtype("<u2")
"""Shares of a histogram in 1/65535."""


class FrameObservations(msgspec.Struct, frozen=True, kw_only=True):
    """Whom a camera has detected in a frame that it has searched."""

    pulse: Pulse
    boxes: Annotated[list[ScoredBox], msgspec.Meta(max_length=FRAME_DETECTIONS_MAX)]
    """Where they were before the camera moved: there its homography holds."""
    histograms: Annotated[bytes, msgspec.Meta(max_length=_HISTOGRAMS_BYTES_MAX)] = b""
    """A color histogram of each: (boxes, bins) shares of 1/65535, little-endian; empty: unknown."""


def pack_histograms(histograms: NDArray[np.float64]) -> bytes:
    """Pack histograms (K, B), whose rows sum to 1."""
    return np.rint(np.clip(histograms, 0.0, 1.0) * np.iinfo(_SHARE).max).astype(_SHARE).tobytes()


def holds_histograms(frame: FrameObservations) -> bool:
    """Return whether there is a histogram of every box, all of them alike, or none at all."""
    size = len(frame.histograms)
    return size % (len(frame.boxes) * _SHARE.itemsize) == 0 if frame.boxes else not size


def unpack_observations(frame: FrameObservations) -> Detections:
    """Return a frame's detections, without boxes that have no size; `holds_histograms` must be true."""
    rows = np.array(frame.boxes, dtype=np.float64).reshape(-1, 5)
    shares = np.frombuffer(frame.histograms, _SHARE).astype(np.float64)
    histograms = shares.reshape(len(rows), shares.size // max(len(rows), 1))
    histograms /= np.maximum(histograms.sum(axis=1, keepdims=True), 1.0)
    kept = (rows[:, 0] < rows[:, 2]) & (rows[:, 1] < rows[:, 3])
    return Detections(rows[kept, :4], rows[kept, 4], histograms[kept])
