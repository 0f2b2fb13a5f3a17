"""Measurements of a tracker for the survey's Table 1, on one view and over all views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

from benchmarks.baselines import DetectedView, run_tracker
from tracking.evaluation import Scores, evaluate, find_occlusions, identities_kept

REAL_TIME = 25.0
"""Frame rate of cameras, and of the survey's videos."""


@dataclass(frozen=True, slots=True)
class ViewMeasurement:
    """The measurements of a tracker on one view.

    Attributes:
        survived: survived occlusions.
        occlusions: all occlusions.
        scores: of the tracks.
        tracked: people with a correct box, per frame.
        present: people present, per frame.
        milliseconds: of the tracker, per frame.
    """

    survived: int
    occlusions: int
    scores: Scores
    tracked: float
    present: float
    milliseconds: float


@dataclass(frozen=True, slots=True)
class TrackerRow:
    """A tracker over all views: sums of counts, means of shares, and the lowest frame rate."""

    survived: int
    occlusions: int
    idf1: float
    switches: int
    tracked: float
    present: float
    lowest_fps: float

    @property
    def survival_rate(self) -> float:
        """The share of survived occlusions; 0 without any."""
        return self.survived / max(self.occlusions, 1)


def measure_view(view: DetectedView, tracker: str) -> ViewMeasurement:
    """Measure a tracker on one view."""
    rows, milliseconds = run_tracker(tracker, view)
    around = round(view.fps)
    found = find_occlusions(view.truth, around)
    scores = evaluate(view.truth, rows)
    present = sum(row.confidence != 0.0 for row in view.truth) / len(view.frames)
    survived = sum(identities_kept(found, view.truth, rows, around))
    return ViewMeasurement(survived, len(found), scores, scores.recall * present, present, milliseconds)


def combine(found: Sequence[ViewMeasurement]) -> TrackerRow:
    """Combine a tracker's measurements of all views."""
    return TrackerRow(
        survived=sum(measurement.survived for measurement in found),
        occlusions=sum(measurement.occlusions for measurement in found),
        idf1=fmean(measurement.scores.idf1 for measurement in found),
        switches=sum(measurement.scores.switches for measurement in found),
        tracked=fmean(measurement.tracked for measurement in found),
        present=fmean(measurement.present for measurement in found),
        lowest_fps=1e3 / max(measurement.milliseconds for measurement in found),
    )
