"""A camera's detections in its own pixels, as they were before it moved: what other cameras can use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from server.media.letterbox import Letterbox
from server.messaging.messages import RawDetections
from server.messaging.observations import FrameObservations
from server.messaging.packed_arrays import (
    FRAME_DETECTIONS_MAX,
    PackedDetections,
    pack_detections,
    pack_histograms,
)
from tracking import Detections
from tracking.detectors.background.motion import STILL, Motion


def calibrated_camera_boxes(
    boxes: NDArray[np.float64], letterbox: Letterbox, motion: Motion
) -> NDArray[np.float64]:
    """Return boxes (K, 4) of the site's image in the camera's pixels, where they were before it moved."""
    if motion != STILL:
        boxes = motion.move_boxes_back(boxes, letterbox.site_size)
    return letterbox.boxes_site_to_camera(boxes)


def most_confident(detections: Detections) -> NDArray[np.int64]:
    """Return the indices of the detections with the highest scores, in the detector's order."""
    return np.sort(np.argsort(-detections.scores, kind="stable")[:FRAME_DETECTIONS_MAX])


def packed_detections(
    detections: Detections, chosen: NDArray[np.int64], letterbox: Letterbox, motion: Motion
) -> PackedDetections:
    """Return the chosen detections as a message has them."""
    boxes = calibrated_camera_boxes(detections.boxes[chosen], letterbox, motion)
    return pack_detections(boxes, detections.scores[chosen])


class RawDetectionCollector:
    """Collects the detections of the frames of an epoch, to hide also whom no track follows."""

    def __init__(self) -> None:
        self._frames: list[RawDetections] = []

    def add(self, pulse: int, detections: Detections) -> None:
        """Add the detections of a frame that was searched."""
        chosen = most_confident(detections)
        boxes = pack_detections(detections.boxes[chosen], detections.scores[chosen])
        self._frames.append(RawDetections(pulse=pulse, boxes=boxes))

    def take(self) -> list[RawDetections]:
        """Return the frames since the last call."""
        frames, self._frames = self._frames, []
        return frames


class ObservationCollector:
    """Collects the detections of the frames of an epoch for joint tracking."""

    def __init__(self, letterbox: Letterbox) -> None:
        self._letterbox = letterbox
        self._frames: list[FrameObservations] = []

    def add(self, pulse: int, detections: Detections, motion: Motion) -> None:
        """Add the detections of a frame that was searched."""
        chosen = most_confident(detections)
        boxes = packed_detections(detections, chosen, self._letterbox, motion)
        histograms = pack_histograms(detections.histograms[chosen])
        self._frames.append(FrameObservations(pulse=pulse, boxes=boxes, histograms=histograms))

    def take(self) -> list[FrameObservations]:
        """Return the frames since the last call."""
        frames, self._frames = self._frames, []
        return frames
