"""Groups of merged tracks, and who left one at a split, by maximum a posteriori (Todor 2009, 7.2, 7.3).

The graph is that of Nillius, Sullivan and Carlsson (CVPR 2006): its nodes are tracks of one or several
people, its links the merges and splits between them. A split of N people into m tracks of n_i people has `Π
C(N - n_1 - … - n_{i-1}, n_i)` states. Here one person leaves at a time: two tracks, N states. The
probability of a state is the product of `exp(-λ I)` over the single-person tracks that it links, where I is
their appearance distance, combined with a motion distance if they are close in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from tracking.appearance import appearance_distance_matrix
from tracking.baselines.frame_by_frame import StepwiseTrack
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

    min_covered_share: float = 0.5  # share of a box that another must cover for the tracks to merge
    merge_after_s: float = 0.12  # seconds without a match after which they merge
    split_margin: float = 0.5  # widths around a group in which a new track counts as split from it
    split_decision_s: float = 0.24  # seconds of a new track before its identity is decided
    max_group_s: float = 10.0  # seconds after which a member of a group is dropped
    motion_s: float = 1.0  # gap in seconds between two tracks up to which motion counts
    max_distance: float = 0.5  # distance above which a new track is no member of the group

    def __post_init__(self) -> None:
        if not 0.0 < self.min_covered_share <= 1.0 or self.split_margin < 0.0:
            raise ValueError("min_covered_share is a share above 0, split_margin at least 0")
        if not min(self.merge_after_s, self.split_decision_s, self.max_group_s) > 0.0:
            raise ValueError("merge_after_s, split_decision_s and max_group_s must be above 0")


_MOTION = 0.3
"""Weight of the motion distance between two tracks that are close in time."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackEndpoint:
    """One end of one person's track: where it merged into a group, or split from one.

    Attributes:
        frame: the last frame of a merged track, the first frame of a split one.
        position: `(2,)`, the center of the box in that frame, pixels.
        velocity: `(2,)`, pixels per frame; not used for a split track.
        height: of the box, pixels.
        histogram: `(B,)`, the mean histogram of the track; B is 0 if there is none.
    """

    frame: int
    position: Floats
    velocity: Floats
    height: float
    histogram: Floats


def track_distance(before: TrackEndpoint, after: TrackEndpoint, motion_frames: int) -> float:
    """Return the distance I of two tracks of one person, 0 to 1.

    If they are at most `motion_frames` apart, it includes the distance of the second from the position
    predicted by the first, in heights.
    """
    appearance = float(appearance_distance_matrix(before.histogram[None], after.histogram[None])[0, 0])
    frames = after.frame - before.frame
    if frames > motion_frames:
        return appearance
    motion = np.hypot(*(after.position - before.position - frames * before.velocity)) / max(
        before.height, 1.0
    )
    return (1.0 - _MOTION) * appearance + _MOTION * min(float(motion), 1.0)


def departed_member(
    group: Sequence[TrackEndpoint],
    split: TrackEndpoint,
    remaining: TrackEndpoint,
    motion_frames: int,
    max_distance: float,
) -> int | None:
    """Return the index of the group member that split off; `None` if it is none of them.

    Args:
        group: the ends of the members' tracks, at least one.
        split: the start of the track that split off.
        remaining: the start of the group's track after the split; it is compared if one person remains.
        motion_frames: gap between two tracks up to which motion counts.
        max_distance: distance above which no member of the group split off.
    """
    costs = np.array([track_distance(member, split, motion_frames) for member in group])
    if len(group) == 2:  # noqa: PLR2004 — one person on either side
        remaining_costs = np.array([track_distance(member, remaining, motion_frames) for member in group])
        totals = costs + remaining_costs[::-1]
    else:
        totals = costs
    best = int(np.argmin(totals))
    return best if costs[best] <= max_distance else None


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
    """A group of people merged into one track, that of its first member."""

    entries: list[TrackEndpoint]
    """The ends of the members' tracks; the first is the track that continues."""
    merged_tracks: list[KalmanTrack] = field(default_factory=list)
    """The tracks of all members but the first."""


@dataclass(slots=True, eq=False)
class SplitCandidate:
    """A new track beside a group whose identity is not decided yet."""

    track: KalmanTrack
    host: KalmanTrack
    first_frame: int
    first_box: Floats
    first_host_box: Floats
    """The group's box in that frame."""
    appearance: MeanAppearance
    host_appearance: MeanAppearance
