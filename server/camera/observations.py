"""A camera's detections in its own pixels, as they were before it moved: what other cameras can use."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from server.camera.load.skipped_frame_interpolator import SkippedFrames
from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion
from server.messaging.messages import RawDetections
from server.messaging.observations import FrameObservations
from server.messaging.packed_arrays import (
    FRAME_DETECTIONS_MAX,
    pack_detections,
    pack_histograms,
)
from server.messaging.picture_motion import calibrated_boxes
from tracking import Detections

Frame = TypeVar("Frame", RawDetections, FrameObservations)


def calibrated_camera_boxes(
    boxes: NDArray[np.float64], letterbox: Letterbox, motion: PictureMotion | None
) -> NDArray[np.float64]:
    """Return boxes (K, 4) of the site's image in the camera's pixels, where they were before it moved.

    NaN: that was beyond the horizon.
    """
    return letterbox.boxes_site_to_camera(calibrated_boxes(boxes, motion))


def calibrated_detections(
    detections: Detections, letterbox: Letterbox, motion: PictureMotion | None
) -> Detections:
    """Return the detections of the site's image whose boxes were somewhere before the camera moved, there."""
    boxes = calibrated_camera_boxes(detections.boxes, letterbox, motion)
    kept = np.isfinite(boxes).all(axis=1)
    return Detections(boxes[kept], detections.scores[kept], detections.histograms[kept])


def most_confident(detections: Detections) -> Detections:
    """Return the detections with the highest scores, as many as a message has, in the detector's order."""
    if len(detections) <= FRAME_DETECTIONS_MAX:
        return detections
    chosen = np.sort(np.argsort(-detections.scores, kind="stable")[:FRAME_DETECTIONS_MAX])
    return Detections(detections.boxes[chosen], detections.scores[chosen], detections.histograms[chosen])


class _EpochCollector(Generic[Frame]):
    """Collects what the messages of an epoch say about its frames."""

    def __init__(self) -> None:
        self._frames: list[Frame] = []

    def take(self, last: int) -> list[Frame]:
        """Remove and return the frames up to the epoch's last; after missed pulses there is a later one."""
        taken = [frame for frame in self._frames if frame.pulse <= last]
        self._frames = [frame for frame in self._frames if frame.pulse > last]
        return taken


class RawDetectionCollector(_EpochCollector[RawDetections]):
    """Collects the detections of the frames of an epoch, to hide also whom no track follows."""

    def add(self, pulse: int, detections: Detections) -> None:
        """Add the most confident detections of a frame that was searched."""
        boxes = pack_detections(detections.boxes, detections.scores)
        self._frames.append(RawDetections(pulse=pulse, boxes=boxes))


class ObservationCollector(_EpochCollector[FrameObservations]):
    """Collects the detections of the frames of an epoch for joint tracking.

    Frames that load shedding skips have interpolated ones, as in the camera's own tracker: joint tracking
    knows nobody new whom it finds in every second frame only.
    """

    def __init__(self, letterbox: Letterbox, window_stride: int) -> None:
        super().__init__()
        self._letterbox, self._skipped = letterbox, SkippedFrames(window_stride)

    def add(self, pulse: int, detections: Detections, motion: PictureMotion | None) -> None:
        """Add the most confident detections of a frame that was searched."""
        for skipped, interpolated in self._skipped.take((pulse, detections)):
            if interpolated is not None:
                self._append(skipped, interpolated, motion)
        self._append(pulse, detections, motion)

    def skip(self, pulse: int) -> None:
        """Add a frame that was skipped."""
        self._skipped.add(pulse)

    def take(self, last: int) -> list[FrameObservations]:
        """Remove and return the frames up to the epoch's last; skipped ones at its end are left out."""
        self._skipped.forget_until(last)
        return super().take(last)

    def _append(self, pulse: int, detections: Detections, motion: PictureMotion | None) -> None:
        found = calibrated_detections(detections, self._letterbox, motion)
        boxes = pack_detections(found.boxes, found.scores)
        self._frames.append(
            FrameObservations(pulse=pulse, boxes=boxes, histograms=pack_histograms(found.histograms))
        )
