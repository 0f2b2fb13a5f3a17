"""What the track graph remembers: how people look, who is in a group, who came out of one."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from tracking.baselines.stepwise import Followed
from tracking.baselines.track_links import End
from tracking.boxes import Floats
from tracking.types import Detections

Person = Followed[cv2.KalmanFilter]
"""Somebody who is followed."""


@dataclass(frozen=True, slots=True)
class GraphSettings:
    """Merges and splits.

    Raises:
        ValueError: a number makes no sense.
    """

    covered: float = 0.5  # share of a box that another must cover for its person to merge into it
    gone: int = 3  # frames without a match after which they do
    beside: float = 0.5  # widths around a group in which somebody new comes out of it
    wait: int = 6  # frames in which who came out is seen before it is decided who they are
    remember: int = 250  # frames after which somebody in a group is gone
    close: int = 25  # frames between two tracks up to which their motion counts
    unlike: float = 0.5  # distance above which who came out was never in the group

    def __post_init__(self) -> None:
        if not 0.0 < self.covered <= 1.0 or self.beside < 0.0:
            raise ValueError("covered is a share above 0, beside at least 0")
        if min(self.gone, self.wait, self.remember) < 1:
            raise ValueError("gone, wait and remember must be at least 1 frame")


@dataclass(slots=True, eq=False)
class Look:
    """How somebody looks, the mean of some frames."""

    total: Floats
    frames: int = 0

    @staticmethod
    def none(detections: Detections) -> Look:
        """Give the look of somebody not seen yet."""
        return Look(np.zeros(detections.histograms.shape[1]))

    def add(self, histogram: Floats) -> None:
        """Take a frame's `(B,)` in."""
        self.total, self.frames = self.total + histogram, self.frames + 1

    @property
    def mean(self) -> Floats:
        """The mean histogram, `(B,)`."""
        return self.total / max(self.frames, 1)


@dataclass(slots=True, eq=False)
class Group:
    """Several people in one track, which is the first one's."""

    ends: list[End]
    """How everybody went in; the first is who is followed on."""
    hidden: list[Person] = field(default_factory=list)
    """All but the first."""


@dataclass(slots=True, eq=False)
class Leaving:
    """Somebody who came out of a group, and it is not decided yet who they are."""

    person: Person
    group_of: Person
    first: int
    box: Floats
    rest_box: Floats
    """Where the group was then."""
    out: Look
    rest: Look
