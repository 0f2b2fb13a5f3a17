"""State of the track graph: appearances, groups and split candidates."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from tracking.baselines.stepwise import StepwiseTrack
from tracking.baselines.track_links import TrackEnd
from tracking.boxes import Floats
from tracking.types import Detections

KalmanTrack = StepwiseTrack[cv2.KalmanFilter]
"""A track predicted by a Kalman filter."""


@dataclass(frozen=True, slots=True)
class TrackGraphSettings:
    """Merges and splits.

    Raises:
        ValueError: a setting is out of range.
    """

    min_covered_share: float = 0.5  # share of a box that another must cover for its person to merge into it
    merge_after_frames: int = 3  # frames without a match after which they do
    split_margin: float = 0.5  # widths around a group in which somebody new comes out of it
    split_decision_frames: int = 6  # frames in which who came out is seen before it is decided who they are
    max_group_frames: int = 250  # frames after which somebody in a group is gone
    motion_frames: int = 25  # frames between two tracks up to which their motion counts
    max_distance: float = 0.5  # distance above which who came out was never in the group

    def __post_init__(self) -> None:
        if not 0.0 < self.min_covered_share <= 1.0 or self.split_margin < 0.0:
            raise ValueError("min_covered_share is a share above 0, split_margin at least 0")
        if min(self.merge_after_frames, self.split_decision_frames, self.max_group_frames) < 1:
            raise ValueError(
                "merge_after_frames, split_decision_frames and max_group_frames must be at least 1 frame"
            )


@dataclass(slots=True, eq=False)
class MeanAppearance:
    """Mean histogram over some frames."""

    total: Floats
    frames: int = 0

    @staticmethod
    def empty(detections: Detections) -> MeanAppearance:
        """Return an appearance without observations."""
        return MeanAppearance(np.zeros(detections.histograms.shape[1]))

    def add(self, histogram: Floats) -> None:
        """Add a frame's histogram `(B,)`."""
        self.total, self.frames = self.total + histogram, self.frames + 1

    @property
    def mean(self) -> Floats:
        """The mean histogram, `(B,)`."""
        return self.total / max(self.frames, 1)


@dataclass(slots=True, eq=False)
class TrackGroup:
    """Several people merged into one track, the first member's."""

    entries: list[TrackEnd]
    """How everybody went in; the first is who is followed on."""
    merged_tracks: list[KalmanTrack] = field(default_factory=list)
    """All but the first."""


@dataclass(slots=True, eq=False)
class SplitCandidate:
    """A new track beside a group whose identity is not decided yet."""

    track: KalmanTrack
    host: KalmanTrack
    first_frame: int
    first_box: Floats
    first_host_box: Floats
    """Where the group was then."""
    appearance: MeanAppearance
    host_appearance: MeanAppearance
