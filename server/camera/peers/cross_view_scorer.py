"""Cross-view scoring: a camera's detections for its peers, and its own scores corrected by theirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestview import CameraDetections, CameraGeometry, rescore_detections, views_overlap
from server.camera.observations import calibrated_camera_boxes, calibrated_detections, most_confident
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion
from server.messaging.messages import FrameDetections
from server.messaging.packed_arrays import (
    PackedDetections,
    pack_boxes,
    pack_detections,
    unpack_boxes,
    unpack_detections,
)
from server.messaging.picture_motion import is_turned
from tracking import Detections
from tracking.boxes import areas


@dataclass(frozen=True, slots=True)
class PeerDetections:
    """Detections of the peer cameras in a frame; ``is_incomplete``: some expected ones are missing."""

    messages: tuple[FrameDetections, ...] = ()
    is_incomplete: bool = False


class CrossViewScorer:
    """Scores a camera's detections by those of other cameras of the same ground."""

    def __init__(self, config: Config, camera_id: str, size: tuple[int, int], boot: int) -> None:
        self._config, self._camera, self._size, self._boot = config, camera_id, size, boot
        site = config.site
        self._letterbox = Letterbox(size, (site.width, site.height))
        self._geometry = _geometry(config, camera_id, size)
        self._peers: dict[str, tuple[tuple[int, int], CameraGeometry | None]] = {}
        """By peer: its image size, and its geometry; None: it sees none of this camera's ground."""

    def build_message(
        self,
        pulse: int,
        detections: Detections | None,
        motion: PictureMotion | None = None,
        covered: NDArray[np.float64] | None = None,
        *,
        ended: bool = False,
    ) -> FrameDetections:
        """Build the message about a frame, in the camera's pixels; None: detection did not run.

        ``motion``: of the camera since it was calibrated; boxes are where they were before. A camera that was
        turned away says nothing, since nobody knows whom it should see. ``covered``: rectangles (K, 4) of the
        site's image in which it sees nobody.
        """
        boxes, hidden = None, b""
        if detections is not None and not is_turned(motion, self._letterbox.site_size):
            found = calibrated_detections(most_confident(detections), self._letterbox, motion)
            boxes = pack_detections(found.boxes, found.scores)
            if covered is not None:
                rectangles = calibrated_camera_boxes(covered, self._letterbox, motion)
                hidden = pack_boxes(rectangles[np.isfinite(rectangles).all(axis=1)])
        return FrameDetections(
            camera=self._camera,
            boot=self._boot,
            size=self._size,
            pulse=pulse,
            boxes=boxes,
            covered=hidden,
            ended=ended,
        )

    def view_overlaps(self, message: FrameDetections) -> bool:
        """Return whether the sender of a message sees ground that this camera sees."""
        return self._geometry_of(message) is not None

    def rescore(
        self, detections: Detections, messages: Sequence[FrameDetections], motion: PictureMotion | None = None
    ) -> Detections:
        """Return the detections with scores corrected by the peers' detections of the same frame."""
        if is_turned(motion, self._letterbox.site_size):
            return detections
        peers = [
            (
                replace(geometry, covered=unpack_boxes([message.covered])),
                _camera_detections(message.boxes),
            )
            for message in messages
            if message.boxes is not None and (geometry := self._geometry_of(message)) is not None
        ]
        own = calibrated_camera_boxes(detections.boxes, self._letterbox, motion)
        found = CameraDetections(own, detections.scores)
        return replace(
            detections, scores=rescore_detections(self._geometry, found, peers, self._config.track.cross_view)
        )

    def _geometry_of(self, message: FrameDetections) -> CameraGeometry | None:
        cached = self._peers.get(message.camera)
        if cached is None or cached[0] != message.size:
            geometry = _geometry(self._config, message.camera, message.size)
            cached = self._peers[message.camera] = (
                message.size,
                geometry if views_overlap(self._geometry, geometry) else None,
            )
        return cached[1]


def _geometry(config: Config, camera_id: str, size: tuple[int, int]) -> CameraGeometry:
    camera, site = config.camera(camera_id), config.site
    letterbox = Letterbox(size, (site.width, site.height))
    camera_ignore = [np.array(polygon, dtype=np.float64) for polygon in camera.ignore]
    site_ignore = [
        letterbox.site_to_camera(np.array(polygon, dtype=np.float64)) for polygon in config.detect.ignore
    ]
    return CameraGeometry(np.array(camera.ground, dtype=np.float64), size, (*camera_ignore, *site_ignore))


def _camera_detections(packed: PackedDetections) -> CameraDetections:
    """Return boxes and scores as arrays, without boxes that have no size."""
    boxes, scores = unpack_detections(packed)
    kept = areas(boxes) > 0.0
    return CameraDetections(boxes[kept], scores[kept])
