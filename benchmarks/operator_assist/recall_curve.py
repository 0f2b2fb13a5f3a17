"""The share of foreseen failures by the rate of flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt

from benchmarks.operator_assist.assisted_tracking import TrackedClip
from benchmarks.operator_assist.flag_outcomes import is_about
from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.operator_assist.simulated_operator import OperatorProfile
from server.config.sections import FlagSettings
from tracking.interactive import RiskEvent

RISKS = (0.6, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1, 0.0)
"""Risk thresholds of flags."""
_MANY = 600
"""Flags a minute: effectively unlimited."""


@dataclass(frozen=True, slots=True)
class RecallPoint:
    """The failures foreseen by the flags of a risk threshold.

    Attributes:
        risk: the threshold.
        flags: raised flags.
        foreseen: failures with a flag in time; each by its own flag.
        failures: all failures.
        minutes: of video.
    """

    risk: float
    flags: int
    foreseen: int
    failures: int
    minutes: float

    @property
    def share(self) -> float:
        """The share of foreseen failures."""
        return self.foreseen / self.failures if self.failures else 0.0

    @property
    def bound(self) -> float:
        """The upper bound of the share: each flag foresees at most one failure."""
        return min(self.flags / self.failures, 1.0) if self.failures else 0.0


def curve(tracked_clips: Sequence[TrackedClip], person: OperatorProfile) -> list[RecallPoint]:
    """Return the foreseen failures at each risk threshold in clips that were tracked without help."""
    return [_point(tracked_clips, person, FlagSettings(per_minute=_MANY, risk=risk)) for risk in RISKS]


def _point(
    tracked_clips: Sequence[TrackedClip], person: OperatorProfile, settings: FlagSettings
) -> RecallPoint:
    flags = foreseen = 0
    selector = FlagSelector(settings, tracked_clips[0].clip.fps)
    for clip in tracked_clips:
        selector.begin()
        raised = _raised(clip, selector)
        flags += len(raised)
        for failure in clip.failures:
            about = [k for k in raised if is_about(k[1], k[0], failure, clip.clip.fps, person)]
            foreseen += bool(about)
            for matched_flag in about[:1]:
                raised.remove(matched_flag)
    failures = sum(len(clip.failures) for clip in tracked_clips)
    return RecallPoint(
        settings.risk, flags, foreseen, failures, sum(clip.clip.minutes for clip in tracked_clips)
    )


def _raised(tracked_clips: TrackedClip, selector: FlagSelector) -> list[tuple[int, RiskEvent]]:
    """Return the flags of a clip, each with the newest frame when it was raised."""
    windows: dict[int, list[RiskEvent]] = {}
    for newest, event in tracked_clips.risk_events:
        windows.setdefault(newest, []).append(event)
    return [
        (newest, event) for newest, events in windows.items() for event in selector.raised(newest, events)
    ]


def rows(points: Sequence[RecallPoint]) -> list[list[str]]:
    """Return the points as rows of a table: flags, failures, foreseen, upper bound."""
    return [
        [
            f"{point.risk:.2f}" if point.risk else "all",
            f"{point.flags / point.minutes:.1f}",
            f"{point.failures / point.minutes:.1f}",
            f"{point.flags / point.failures:.2f}" if point.failures else "-",
            f"{100.0 * point.share:.0f} %",
            f"{100.0 * point.bound:.0f} %",
        ]
        for point in points
    ]


def plot(points: Sequence[RecallPoint], path: Path) -> None:
    """Draw the share of foreseen failures over flags a minute, with its upper bound."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(7, 4))
    flags = [point.flags / point.minutes for point in points]
    axes.plot(
        flags, [100.0 * point.bound for point in points], color="0.6", label="one failure for each flag"
    )
    axes.plot(flags, [100.0 * point.share for point in points], marker="o", label="foreseen")
    axes.axvline(
        points[0].failures / points[0].minutes, color="0.6", linestyle=":", label="failures a minute"
    )
    axes.set(xlabel="flags a minute", ylabel="failures foreseen, %", ylim=(0, 105))
    axes.legend(loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
