"""Each camera's boxes of the people who are tracked jointly, as track messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion
from server.messaging.messages import TrackMessage
from server.messaging.picture_motion import shown_boxes
from server.messaging.track_conversion import track_message
from tracking import Detections, WindowTrack
from tracking.appearance_histograms import add_appearance_histograms
from tracking.ground_plane import GroundFrame
from tracking.solvers.base import OCCLUDED

_SHOWN_UNDETECTED_S = 0.4
"""Seconds for which a camera shows somebody whom it no longer detects, where they must be by their place."""


class CameraTrackBuilder:
    """Builds the track messages of one camera, window by window."""

    def __init__(self, camera: str, fps: float) -> None:
        self._camera = camera
        self._shown_undetected = _SHOWN_UNDETECTED_S * fps
        self._detected: dict[int, int] = {}
        """By person, the last frame in which this camera has detected them."""

    def tracks(
        self,
        frames: Sequence[GroundFrame],
        final: int,
        detections: Mapping[int, Detections],
        letterbox: Letterbox,
        motion: PictureMotion | None,
    ) -> list[TrackMessage]:
        """Return the tracks of successive frames, the first `final` of which are final.

        `detections` are this camera's, by frame, as the tracker has got them.
        """
        people = sorted({track.id for frame in frames for track in frame.tracks})
        row_of = {number: row for row, number in enumerate(people)}
        boxes = np.full((len(people), len(frames), 4), np.nan)
        states = np.full((len(people), len(frames)), OCCLUDED)
        scores = np.zeros((len(people), len(frames)))
        for at, frame in enumerate(frames):
            for track in frame.tracks:
                found = track.boxes.get(self._camera)
                if found is None:
                    continue
                row = row_of[track.id]
                if found.detection is not None:
                    self._detected[track.id] = frame.frame
                    states[row, at] = found.detection
                    scores[row, at] = detections[frame.frame].scores[found.detection]
                if frame.frame - self._detected.get(track.id, -(2**62)) <= self._shown_undetected:
                    boxes[row, at] = found.box
        oldest = frames[0].frame - self._shown_undetected if frames else 0.0
        self._detected = {number: frame for number, frame in self._detected.items() if frame >= oldest}
        placed = shown_boxes(letterbox.boxes_camera_to_site(boxes), motion)
        shown = [row for row in range(len(people)) if not np.isnan(placed[row]).all()]
        tracks = [
            WindowTrack(people[row], placed[row], placed[row], np.zeros(0), float(scores[row].mean()))
            for row in shown
        ]
        searched = [detections.get(frame.frame, Detections.empty(0)) for frame in frames[:final]]
        first = frames[0].frame if frames else 0
        with_looks = add_appearance_histograms(tracks, [states[row] for row in shown], first, searched)
        return [track_message(track) for track in with_looks]
