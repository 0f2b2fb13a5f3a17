"""The tracker's results as messages have them."""

from __future__ import annotations

from server.messaging.messages import AppearanceHistogram, SolverReport, TrackMessage
from server.messaging.packed_arrays import pack_boxes, pack_histograms
from tracking import SolveReport, WindowTrack


def track_message(track: WindowTrack) -> TrackMessage:
    """Convert a track."""
    # Interpolated boxes: a short occlusion should not cause a cut to another camera.
    return TrackMessage(
        id=track.id,
        boxes=pack_boxes(track.interpolated),
        confidence=float(track.confidence),
        appearance=[
            AppearanceHistogram(first=one.first, last=one.last, histogram=pack_histograms(one.histogram))
            for one in track.appearance_histograms
        ],
    )


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
