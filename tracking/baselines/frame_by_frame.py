"""What all frame-by-frame trackers share: gaps, confirmation and end of tracks, and their results.

A track is confirmed in its third consecutive matched frame. Without a match for `max_missed_s` seconds it
ends; its id is not used again.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from tracking.appearance_histograms import add_appearance_histograms
from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS, frames_in
from tracking.model.object_state import mean_histogram, uniform_histogram
from tracking.solvers.base import OCCLUDED, SolveReport
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings, WindowTrack

S = TypeVar("S")
"""A tracker's state of one target."""


@dataclass(frozen=True, slots=True)
class StepwiseSettings:
    """Settings of initiation, association and termination.

    Raises:
        ValueError: a setting is out of range.
    """

    min_birth_score: float = 0.5  # least score of a detection that starts a track
    max_birth_iou: float = 0.3  # overlap (IoU) with a track above which a detection starts none
    min_match_iou: float = 0.3  # least overlap (IoU) of a track and its matched detection
    confirm_frames: int = 3  # consecutive matched frames that confirm a track
    max_missed_s: float = 1.0  # seconds without a match after which a track ends
    max_unmatched_s: float = 0.2  # seconds without a match in which an image-based prediction is published

    def __post_init__(self) -> None:
        shares = (self.min_birth_score, self.max_birth_iou, self.min_match_iou)
        if not all(0.0 <= share <= 1.0 for share in shares):
            raise ValueError(
                f"min_birth_score, max_birth_iou and min_match_iou are shares between 0 and 1, not {shares}"
            )
        if self.confirm_frames < 1 or not self.max_missed_s > 0.0 or self.max_unmatched_s < 0.0:
            raise ValueError(
                "confirm_frames must be at least 1, max_missed_s above 0, max_unmatched_s at least 0"
            )


@dataclass(slots=True)
class StepwiseTrack(Generic[S]):
    """One track of a frame-by-frame tracker."""

    id: int
    """Published id; 0 before the track is published."""
    target: S
    box: Floats
    serial: int
    """Unique number, also while unpublished."""
    matches: int = 1
    missed_frames: int = 0
    """Frames since the last match."""
    observations: dict[int, tuple[Floats, int]] = field(default_factory=dict)
    """By frame of the window: the box, and the index of its detection, -1 for none."""


class FrameByFrameTracker(ABC, Generic[S]):
    """A tracker that decides frame by frame. Its results are final immediately."""

    def __init__(
        self,
        name: str,
        window: WindowSettings,
        settings: StepwiseSettings | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        self._name, self._window = name, window.resolve(fps)
        self._settings = settings or StepwiseSettings()
        self._max_missed = frames_in(self._settings.max_missed_s, fps)
        self._max_unmatched = frames_in(self._settings.max_unmatched_s, fps, 0)
        self._objects: list[StepwiseTrack[S]] = []
        self._ended: list[StepwiseTrack[S]] = []
        """Tracks that ended since the last result."""
        self._last_id = self._last_serial = 0
        self._detections: dict[int, Detections] = {}
        self._first: int | None = None
        self._last: int | None = None

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Add a frame; return a result if one or more windows end.

        Skipped frame numbers are frames without data. After a gap longer than `forget_after` of the window
        all tracks are dropped, and the frames of the gap are in no result.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        if self._last is not None and frame <= self._last:
            raise ValueError(f"frame {frame} came after frame {self._last}")
        if self._last is not None and frame - self._last > self._window.forget_after:
            return self._restart(frame, detections, image)
        if self._last is not None:
            self._skip_frames(frame - self._last - 1)
        if self._first is None:
            self._first = frame
        self._detections[frame] = detections
        self._step(frame, detections, image)
        stride, before = self._window.stride, self._first - 1 if self._last is None else self._last
        self._last = frame
        return self._result(frame) if (frame + 1) // stride > (before + 1) // stride else None

    def flush(self) -> WindowResult | None:
        """End the recording; return the last result, or `None` if all frames were published."""
        if self._first is None or self._last is None or self._last < self._first:
            return None
        return self._result(self._last)

    def _restart(self, frame: int, detections: Detections, image: Image | None) -> WindowResult | None:
        """Restart after a long gap, so that no result spans it."""
        result = self.flush()
        self._objects, self._detections = [], {frame: detections}
        self._first = self._last = frame
        self._step(frame, detections, image)
        return result

    def _skip_frames(self, frames: int) -> None:
        """Count frames without data as missed."""
        for track in self._objects:
            track.missed_frames += frames
        self._end_lost_tracks()

    @abstractmethod
    def _step(self, frame: int, detections: Detections, image: Image | None) -> None:
        """Update all tracks by a frame: start, match and end them."""

    def _end_lost_tracks(self) -> None:
        lost = [track for track in self._objects if track.missed_frames >= self._max_missed]
        self._ended += [track for track in lost if track.matches >= self._settings.confirm_frames]
        self._objects = [track for track in self._objects if track.missed_frames < self._max_missed]

    def _result(self, last: int) -> WindowResult:
        """Return the result for all frames not yet published."""
        first = last if self._first is None else self._first
        frames = range(first, last + 1)
        confirmed = [track for track in self._all_tracks() if self._is_confirmed(track)]
        for track in confirmed:
            if not track.id:
                self._last_id += 1
                track.id = self._last_id
        confirmed = sorted((track for track in confirmed if track.observations), key=lambda track: track.id)
        detections = [self._detections.get(frame, Detections.empty(self._bins())) for frame in frames]
        tracks = [self._window_track(track, frames, detections) for track in confirmed]
        states = [
            np.array(
                [
                    track.observations[frame][1] if frame in track.observations else OCCLUDED
                    for frame in frames
                ],
                dtype=np.int64,
            )
            for track in confirmed
        ]
        report = SolveReport(self._name, 0.0, 0.0, integral=False, conflicts=0, rounds=0)
        result = WindowResult(
            first, last, last, add_appearance_histograms(tracks, states, first, detections), report
        )
        for track in self._all_tracks():
            # An unconfirmed track is published from the window in which it is confirmed.
            track.observations = {}
        self._ended, self._detections, self._first = [], {}, last + 1
        return result

    def _all_tracks(self) -> Iterable[StepwiseTrack[S]]:
        """Return all tracks that may have unpublished observations."""
        return (*self._ended, *self._objects)

    def _is_confirmed(self, track: StepwiseTrack[S]) -> bool:
        """Return whether a track is confirmed."""
        return track.matches >= self._settings.confirm_frames

    def _bins(self) -> int:
        return next((detections.histograms.shape[1] for detections in self._detections.values()), 0)

    def _window_track(
        self, track: StepwiseTrack[S], frames: range, detections: list[Detections]
    ) -> WindowTrack:
        boxes = np.full((len(frames), BOX_SIDES), np.nan)
        histograms, score = [], 0.0
        for row, frame in enumerate(frames):
            if frame in track.observations:
                boxes[row], index = track.observations[frame]
                if index != OCCLUDED:
                    histograms.append(detections[row].histograms[index])
                    score += float(detections[row].scores[index])
        histogram = mean_histogram(np.stack(histograms)) if histograms else uniform_histogram(self._bins())
        return WindowTrack(track.id, boxes, boxes, histogram, score / len(frames))
