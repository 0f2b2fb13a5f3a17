"""Frame-by-frame trackers with a prediction method: one assignment per frame, decisions are final.

All of them start, match and end tracks in the same way, so that comparisons measure the prediction method
only. A detection that overlaps no track starts a new one, which is confirmed in its third consecutive frame.
In each frame tracks and detections are matched by one assignment over their overlaps (IoU). A track without a
match for `max_missed_s` seconds ends; its id is not used again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from tracking.assignment import assign_pairs
from tracking.baselines.frame_by_frame import FrameByFrameTracker, StepwiseSettings, StepwiseTrack
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections
from tracking.window import WindowSettings

S = TypeVar("S")
"""A prediction method's state of one target."""


class PredictionMethod(Protocol, Generic[S]):
    """Predicts targets from image to image. Deterministic: no clock, and only seeded random numbers."""

    name: str
    uses_image: bool
    """Whether it uses the image: its predictions then count for some frames without a detection."""

    def initialize(self, image: Image, box: Floats) -> S:
        """Create a target from a box `(4,)`. A method that does not use images gets an empty one."""
        ...

    def predict(self, image: Image | None, targets: Sequence[S]) -> Floats:
        """Predict the boxes in the next image: `(N, 4)`, NaN for targets that are lost."""
        ...

    def update(self, target: S, box: Floats, /) -> Floats:
        """Update a target with its matched detection `(4,)`; return its new box `(4,)`.

        Methods that follow the image alone ignore the detection.
        """
        ...


_NO_IMAGE: Image = np.empty((0, 0, 3), dtype=np.uint8)


class StepwiseTracker(FrameByFrameTracker[S]):
    """Frame-by-frame tracker with a prediction method."""

    def __init__(
        self,
        method: PredictionMethod[S],
        window: WindowSettings,
        settings: StepwiseSettings | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        super().__init__(method.name, window, settings, fps)
        self._method = method

    def _step(self, frame: int, detections: Detections, image: Image | None) -> None:
        moved = self._method.predict(image, [track.target for track in self._objects])
        for track, box in zip(self._objects, moved, strict=True):
            track.box = box if not np.isnan(box).any() else track.box
        matched = self._match(frame, detections)
        for track in self._objects:
            if frame not in track.observations:
                track.missed_frames += 1
                if track.matches < self._settings.confirm_frames:
                    track.missed_frames = self._max_missed  # an unconfirmed track ends at its first miss
                elif self._method.uses_image and track.missed_frames <= self._max_unmatched:
                    track.observations[frame] = (track.box, OCCLUDED)
        self._end_lost_tracks()
        self._start_tracks(frame, detections, matched, image)

    def _match(self, frame: int, detections: Detections) -> NDArray[np.bool_]:
        """Match tracks with detections; return which detections are matched, `(K,)`."""
        matched = np.zeros(len(detections), dtype=np.bool_)
        if not self._objects or not len(detections):
            return matched
        boxes = np.stack([track.box for track in self._objects])
        overlaps = iou(boxes[:, None], detections.boxes[None])
        for row, column in zip(*assign_pairs(overlaps, max(self._settings.min_match_iou, 1e-9)), strict=True):
            track = self._objects[row]
            track.box = self._method.update(track.target, detections.boxes[column])
            track.matches, track.missed_frames = track.matches + 1, 0
            track.observations[frame] = (track.box, int(column))
            matched[column] = True
        return matched

    def _start_tracks(
        self, frame: int, detections: Detections, matched: NDArray[np.bool_], image: Image | None
    ) -> None:
        """Start tracks from unmatched detections, in descending order of score."""
        if image is None:
            if self._method.uses_image:
                return  # no appearance to track them by
            image = _NO_IMAGE
        order = np.argsort(-detections.scores, kind="stable")
        for index in (int(row) for row in order if not matched[row]):
            box = detections.boxes[index]
            if detections.scores[index] < self._settings.min_birth_score:
                break
            near = [track.box for track in self._objects]
            if near and float(iou(box[None], np.stack(near)).max()) > self._settings.max_birth_iou:
                continue
            self._last_serial += 1
            track = StepwiseTrack(0, self._method.initialize(image, box), box, self._last_serial)
            track.observations[frame] = (box, index)
            self._objects.append(track)
