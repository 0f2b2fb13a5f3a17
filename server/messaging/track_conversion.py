"""The tracker's results as messages have them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import tracking
from server.messaging.messages import AppearanceHistogram, Box, SolverReport, TrackMessage
from server.messaging.number_types import COORDINATE_MAX
from tracking import SolveReport, WindowTrack

_SHARE_DIGITS = 5
"""Decimals of histogram values."""


def track_message(track: WindowTrack) -> TrackMessage:
    """Convert a track."""
    # Interpolated boxes: a short occlusion should not cause a cut to another camera.
    return TrackMessage(
        id=track.id,
        boxes=[_box(row) for row in track.interpolated],
        confidence=float(track.confidence),
        appearance=[_appearance_message(histogram) for histogram in track.appearance_histograms],
    )


def _appearance_message(appearance: tracking.AppearanceHistogram) -> AppearanceHistogram:
    shares = [round(float(share), _SHARE_DIGITS) for share in appearance.histogram]
    return AppearanceHistogram(first=appearance.first, last=appearance.last, histogram=shares)


def _box(row: NDArray[np.float64]) -> Box | None:
    left, top, right, bottom = (float(side) for side in np.clip(row, -COORDINATE_MAX, COORDINATE_MAX))
    return None if np.isnan(left) else (left, top, right, bottom)


def solver_report(report: SolveReport | None) -> SolverReport | None:
    """Convert a solver's report; None: there is none."""
    if report is None:
        return None
    return SolverReport(
        objective=report.objective,
        bound=report.bound,
        gap=report.gap,
        integral=report.integral,
        rounds=report.rounds,
        limit=report.limit,
    )
