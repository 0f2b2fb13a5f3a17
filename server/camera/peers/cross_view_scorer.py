"""What a camera tells the others that it found in a frame, and how it goes by what they tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestview import CameraDetections, CameraGeometry, rescore_detections, views_overlap
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.messages import FRAME_DETECTIONS_MAX, FrameDetections
from server.messaging.number_types import COORDINATE_MAX
from tracking import Detections

Floats = NDArray[np.float64]

_PIXEL_DIGITS, _SCORE_DIGITS = 1, 3


@dataclass(frozen=True, slots=True)
class PeerDetections:
    """Detections of the other cameras in a frame; ``alone``: they were needed and did not come."""

    words: tuple[FrameDetections, ...] = ()
    alone: bool = False


class CrossViewScorer:
    """Scores a camera's detections by those of other cameras of the same ground."""

    def __init__(self, config: Config, camera_id: str, size: tuple[int, int], boot: int) -> None:
        self._config, self._camera, self._size, self._boot = config, camera_id, size, boot
        site = config.site
        self._fit = Letterbox(size, (site.width, site.height))
        self._own = _vantage(config, camera_id, size)
        self._others: dict[str, tuple[tuple[int, int], CameraGeometry | None]] = {}
        """The others' sizes of picture, and where they look from; None: at none of this camera's ground."""

    def word(self, pulse: int, detections: Detections | None, *, ended: bool = False) -> FrameDetections:
        """Return what was found in a frame; None: nobody was looked for."""
        boxes = None
        if detections is not None:
            # The surest, in the detector's order.
            most = np.sort(np.argsort(-detections.scores, kind="stable")[:FRAME_DETECTIONS_MAX])
            places = self._fit.boxes_to_own(detections.boxes[most]).round(_PIXEL_DIGITS)
            scores = detections.scores[most].round(_SCORE_DIGITS)
            rows = np.clip(np.column_stack([places, scores]), -COORDINATE_MAX, COORDINATE_MAX)
            boxes = [(row[0], row[1], row[2], row[3], row[4]) for row in rows.tolist()]
        return FrameDetections(
            camera=self._camera, boot=self._boot, size=self._size, pulse=pulse, boxes=boxes, ended=ended
        )

    def looks_here(self, word: FrameDetections) -> bool:
        """Return whether the camera whose word this is looks at ground that this one sees."""
        return self._vantage_of(word) is not None

    def scored(self, detections: Detections, words: Sequence[FrameDetections]) -> Detections:
        """Return the detections with the scores that they have by what the others found in the same frame."""
        others = [
            (vantage, _findings(word.boxes))
            for word in words
            if word.boxes is not None and (vantage := self._vantage_of(word)) is not None
        ]
        found = CameraDetections(self._fit.boxes_to_own(detections.boxes), detections.scores)
        return replace(
            detections, scores=rescore_detections(self._own, found, others, self._config.track.cross_view)
        )

    def _vantage_of(self, word: FrameDetections) -> CameraGeometry | None:
        known = self._others.get(word.camera)
        if known is None or known[0] != word.size:
            vantage = _vantage(self._config, word.camera, word.size)
            known = self._others[word.camera] = (
                word.size,
                vantage if views_overlap(self._own, vantage) else None,
            )
        return known[1]


def _vantage(config: Config, camera_id: str, size: tuple[int, int]) -> CameraGeometry:
    camera, site = config.camera(camera_id), config.site
    fit = Letterbox(size, (site.width, site.height))
    own = [np.array(polygon, dtype=np.float64) for polygon in camera.ignore]
    shared = [fit.to_own(np.array(polygon, dtype=np.float64)) for polygon in config.detect.ignore]
    return CameraGeometry(np.array(camera.ground, dtype=np.float64), size, (*own, *shared))


def _findings(rows: Sequence[tuple[float, ...]]) -> CameraDetections:
    """Return boxes and scores as arrays, without boxes that have no size."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    table = table[(table[:, 0] < table[:, 2]) & (table[:, 1] < table[:, 3])]
    return CameraDetections(table[:, :4], table[:, 4])
