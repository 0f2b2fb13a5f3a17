"""What stands in the survey's Table 1 of one tracker, on one view and over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

from benchmarks.baselines import SearchedView, follow
from tracking.evaluation import Scores, evaluate, find_occlusions, identities_kept

REAL_TIME = 25.0
"""Frames a second that cameras send, and that the survey's videos have."""


@dataclass(frozen=True, slots=True)
class ViewMeasurement:
    """One tracker on one view.

    Attributes:
        kept: occlusions after which the number is the same.
        hidden: all occlusions.
        scores: what else is measured of the tracks.
        followed: people whose boxes are right, per frame.
        there: people who are there, per frame.
        milliseconds: that the tracker takes for a frame.
    """

    kept: int
    hidden: int
    scores: Scores
    followed: float
    there: float
    milliseconds: float


@dataclass(frozen=True, slots=True)
class TrackerRow:
    """One tracker over all views: sums of counts, means of shares, and the slowest view's frames a second."""

    kept: int
    hidden: int
    idf1: float
    switches: int
    followed: float
    there: float
    slowest: float

    @property
    def share_kept(self) -> float:
        """The share of all occlusions that were survived; 0 of none."""
        return self.kept / max(self.hidden, 1)


def measured(view: SearchedView, tracker: str) -> ViewMeasurement:
    """Let one tracker follow one view."""
    rows, milliseconds = follow(tracker, view)
    around = round(view.fps)
    found = find_occlusions(view.truth, around)
    scores = evaluate(view.truth, rows)
    there = sum(row.confidence != 0.0 for row in view.truth) / len(view.frames)
    kept = sum(identities_kept(found, view.truth, rows, around))
    return ViewMeasurement(kept, len(found), scores, scores.recall * there, there, milliseconds)


def summed(found: Sequence[ViewMeasurement]) -> TrackerRow:
    """Put one tracker's views together."""
    return TrackerRow(
        kept=sum(it.kept for it in found),
        hidden=sum(it.hidden for it in found),
        idf1=fmean(it.scores.idf1 for it in found),
        switches=sum(it.scores.switches for it in found),
        followed=fmean(it.followed for it in found),
        there=fmean(it.there for it in found),
        slowest=1e3 / max(it.milliseconds for it in found),
    )
