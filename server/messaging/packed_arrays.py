"""Arrays inside messages, as bytes: a fifth of the size of JSON, and NumPy reads them without a loop."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from server.messaging.number_types import COORDINATE_MAX

_Box = tuple[float, float, float, float]

_COORDINATE = np.dtype("<f4")
_BOX_BYTES = 4 * _COORDINATE.itemsize
_DETECTION_BYTES = 5 * _COORDINATE.itemsize
_SHARE = np.dtype("<u2")
"""Shares of a histogram in 1/65535."""
_HIDDEN: _Box = (np.nan,) * 4

FRAME_DETECTIONS_MAX = 100
"""Detections of one frame, at most; those with the highest scores."""

HISTOGRAM_BINS_MAX = 1024
"""Bins of a histogram, at most; more would not distinguish people better."""

PackedBoxes = bytes
"""Boxes one after the other: left, top, right, bottom as little-endian float32; NaN where hidden."""

COVERED_MAX = 600
"""Rectangles of what is covered in a picture, at most."""

PackedAreas = Annotated[bytes, msgspec.Meta(max_length=COVERED_MAX * _BOX_BYTES)]
"""Rectangles, packed as boxes, none of them hidden."""

PackedDetections = Annotated[bytes, msgspec.Meta(max_length=FRAME_DETECTIONS_MAX * _DETECTION_BYTES)]
"""Boxes in pixels of the camera's image, each followed by its score, 0 to 1, as little-endian float32."""

PackedHistogram = Annotated[bytes, msgspec.Meta(max_length=HISTOGRAM_BINS_MAX * _SHARE.itemsize)]
"""Shares of 1/65535 as little-endian integers of 16 bits."""


def pack_boxes(boxes: NDArray[np.float64] | Sequence[_Box | None]) -> PackedBoxes:
    """Pack boxes (N, 4), NaN or None where hidden; coordinates are limited to `COORDINATE_MAX`."""
    rows = boxes if isinstance(boxes, np.ndarray) else [box or _HIDDEN for box in boxes]
    array = np.clip(np.array(rows, dtype=np.float64).reshape(-1, 4), -COORDINATE_MAX, COORDINATE_MAX)
    array[np.isnan(array).any(axis=1)] = np.nan
    return array.astype(_COORDINATE).tobytes()


def unpack_boxes(packed: Iterable[PackedBoxes]) -> NDArray[np.float64]:
    """Return the boxes of several tracks one after the other, (B, 4), NaN where hidden."""
    return np.frombuffer(b"".join(packed), _COORDINATE).reshape(-1, 4).astype(np.float64)


def last_box(packed: PackedBoxes) -> _Box | None:
    """Return the last box; None: it is hidden, or there is none."""
    if not packed:
        return None
    left, top, right, bottom = unpack_boxes([packed[-_BOX_BYTES:]])[0].tolist()
    return None if np.isnan(left) else (left, top, right, bottom)


def first_boxes(packed: PackedBoxes, count: int) -> PackedBoxes:
    """Return the first boxes, at most all."""
    return packed[: count * _BOX_BYTES]


def are_boxes(packed: Sequence[PackedBoxes], count: int) -> bool:
    """Return whether each holds so many boxes, whose coordinates are within the limits or all NaN."""
    if any(len(boxes) != count * _BOX_BYTES for boxes in packed):
        return False
    boxes = unpack_boxes(packed)
    hidden = np.isnan(boxes)
    within = hidden | (np.abs(boxes) <= COORDINATE_MAX)
    return bool(within.all() and (hidden.all(axis=1) == hidden.any(axis=1)).all())


def check_areas(packed: PackedAreas) -> None:
    """Check the rectangles that a sender has packed.

    Raises:
        ValueError: they are none, or coordinates are outside of their limits.
    """
    if len(packed) % _BOX_BYTES or not (np.abs(unpack_boxes([packed])) <= COORDINATE_MAX).all():
        raise ValueError("rectangles are rows of four coordinates within their limits")


def pack_detections(boxes: NDArray[np.float64], scores: NDArray[np.float64]) -> PackedDetections:
    """Pack boxes (N, 4) and their scores (N,), 0 to 1; coordinates are limited to `COORDINATE_MAX`."""
    rows = np.column_stack([np.clip(boxes, -COORDINATE_MAX, COORDINATE_MAX), scores])
    return rows.astype(_COORDINATE).tobytes()


def unpack_detections(packed: PackedDetections) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return boxes (N, 4) and their scores (N,)."""
    rows = np.frombuffer(packed, _COORDINATE).reshape(-1, 5).astype(np.float64)
    return rows[:, :4], rows[:, 4]


def select_detections(packed: PackedDetections, kept: NDArray[np.bool_]) -> PackedDetections:
    """Return some of N packed detections, those of the mask (N,)."""
    return np.frombuffer(packed, _COORDINATE).reshape(-1, 5)[kept].tobytes()


def check_detections(packed: PackedDetections) -> int:
    """Check what a sender has packed; return the number of detections.

    Raises:
        ValueError: these are no detections, or numbers are outside of their limits.
    """
    if len(packed) % _DETECTION_BYTES:
        raise ValueError("detections are not rows of five numbers")
    boxes, scores = unpack_detections(packed)
    # NaN is within no limits.
    if not ((np.abs(boxes) <= COORDINATE_MAX).all() and ((scores >= 0) & (scores <= 1)).all()):
        raise ValueError("a detection's box or score is outside of its limits")
    return len(scores)


def pack_histograms(histograms: NDArray[np.float64]) -> bytes:
    """Pack histograms (K, B) whose rows sum to 1, or one of them (B)."""
    return np.rint(np.clip(histograms, 0.0, 1.0) * np.iinfo(_SHARE).max).astype(_SHARE).tobytes()


def unpack_histograms(packed: bytes, count: int) -> NDArray[np.float64]:
    """Return histograms (count, B) whose rows sum to 1; they must be equally long."""
    shares = np.frombuffer(packed, _SHARE).astype(np.float64)
    histograms = shares.reshape(count, shares.size // max(count, 1))
    return np.asarray(histograms / np.maximum(histograms.sum(axis=1, keepdims=True), 1.0))


def select_histograms(packed: bytes, kept: NDArray[np.bool_]) -> bytes:
    """Return some of N packed histograms, those of the mask (N,)."""
    shares = np.frombuffer(packed, _SHARE)
    return shares.reshape(len(kept), shares.size // max(len(kept), 1))[kept].tobytes()


def histogram_bins(packed: bytes, count: int = 1) -> int | None:
    """Return the bins of each of some packed histograms; None: they are not equally long."""
    bins, rest = divmod(len(packed), count * _SHARE.itemsize) if count else (0, len(packed))
    return None if rest else bins
