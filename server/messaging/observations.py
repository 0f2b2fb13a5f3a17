"""What a camera's detector finds in a frame, for joint tracking on a common ground."""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from server.messaging.number_types import Pulse
from server.messaging.packed_arrays import (
    PackedDetections,
    check_detections,
    histogram_bins,
    select_detections,
    select_histograms,
    unpack_detections,
    unpack_histograms,
)
from tracking import Detections
from tracking.boxes import areas

_HISTOGRAMS_BYTES_MAX = 1 << 18


class FrameObservations(msgspec.Struct, frozen=True, kw_only=True):
    """Whom a camera has detected in a frame that it has searched."""

    pulse: Pulse
    boxes: PackedDetections = b""
    """Where they were before the camera moved: there its homography holds."""
    histograms: Annotated[bytes, msgspec.Meta(max_length=_HISTOGRAMS_BYTES_MAX)] = b""
    """A color histogram of each: shares of 1/65535, 16 bits, little-endian; empty: unknown."""

    def __post_init__(self) -> None:
        """Check the arrays.

        Raises:
            ValueError: they do not fit together; decoders then raise a `ValidationError`.
        """
        if histogram_bins(self.histograms, check_detections(self.boxes)) is None:
            raise ValueError("there is not a histogram of every box")


def select_observations(frame: FrameObservations, kept: NDArray[np.bool_]) -> FrameObservations:
    """Return a frame with some of its N detections, those of the mask (N,)."""
    return msgspec.structs.replace(
        frame,
        boxes=select_detections(frame.boxes, kept),
        histograms=select_histograms(frame.histograms, kept),
    )


def unpack_observations(frame: FrameObservations) -> Detections:
    """Return a frame's detections, without boxes that have no size."""
    boxes, scores = unpack_detections(frame.boxes)
    histograms = unpack_histograms(frame.histograms, len(scores))
    kept = areas(boxes) > 0.0
    return Detections(boxes[kept], scores[kept], histograms[kept])
