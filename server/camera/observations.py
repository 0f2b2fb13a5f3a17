"""A camera's detections in its own pixels, as they were before it moved: what other cameras can use."""

from __future__ import annotations

from typing import Generic, TypeVar

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

Frame = TypeVar("Frame", RawDetections, FrameObservations)


def calibrated_camera_boxes(
    boxes: NDArray[np.float64], letterbox: Letterbox, motion: Motion
) -> NDArray[np.float64]:
    """Return boxes (K, 4) of the site's image in the camera's pixels, where they were before it moved."""
    if motion != STILL:
        boxes = motion.move_boxes_back(boxes, letterbox.site_size)
    return letterbox.boxes_site_to_camera(boxes)


def most_confident(detections: Detections) -> Detections:
    """Return the detections with the highest scores, as many as a message has, in the detector's order."""
    if len(detections) <= FRAME_DETECTIONS_MAX:
        return detections
    chosen = np.sort(np.argsort(-detections.scores, kind="stable")[:FRAME_DETECTIONS_MAX])
    return Detections(detections.boxes[chosen], detections.scores[chosen], detections.histograms[chosen])


def packed_detections(detections: Detections, letterbox: Letterbox, motion: Motion) -> PackedDetections:
    """Return detections as a message has them."""
    return pack_detections(calibrated_camera_boxes(detections.boxes, letterbox, motion), detections.scores)


class _EpochCollector(Generic[Frame]):
    """Collects what the messages of an epoch say about its frames."""

    def __init__(self) -> None:
        self._frames: list[Frame] = []

    def take(self) -> list[Frame]:
        """Return the frames since the last call."""
        frames, self._frames = self._frames, []
        return frames


class RawDetectionCollector(_EpochCollector[RawDetections]):
    """Collects the detections of the frames of an epoch, to hide also whom no track follows."""

    def add(self, pulse: int, detections: Detections) -> None:
        """Add the most confident detections of a frame that was searched."""
        boxes = pack_detections(detections.boxes, detections.scores)
        self._frames.append(RawDetections(pulse=pulse, boxes=boxes))


class ObservationCollector(_EpochCollector[FrameObservations]):
    """Collects the detections of the frames of an epoch for joint tracking."""

    def __init__(self, letterbox: Letterbox) -> None:
        super().__init__()
        self._letterbox = letterbox

    def add(self, pulse: int, detections: Detections, motion: Motion) -> None:
        """Add the most confident detections of a frame that was searched."""
        boxes = packed_detections(detections, self._letterbox, motion)
        histograms = pack_histograms(detections.histograms)
        self._frames.append(FrameObservations(pulse=pulse, boxes=boxes, histograms=histograms))
