"""How many failures are foreseen by so many flags a minute."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt

from benchmarks.operator_assist.assisted_tracking import TrackedClip
from benchmarks.operator_assist.flag_outcomes import tells
from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.operator_assist.simulated_operator import OperatorProfile
from server.config.sections import FlagSettings
from tracking.interactive import RiskEvent

RISKS = (0.6, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1, 0.0)
"""Risks from which a flag is raised."""
_MANY = 600
"""Flags a minute: no fewer than that."""


@dataclass(frozen=True, slots=True)
class RecallPoint:
    """What flags of one risk foresee.

    Attributes:
        risk: from which a flag is raised.
        flags: flags that were raised.
        foreseen: failures that a flag told of in time; each by a flag of its own.
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
        """The share of the failures that is foreseen."""
        return self.foreseen / self.failures if self.failures else 0.0

    @property
    def bound(self) -> float:
        """The share that as many flags could foresee at most: a flag tells of one failure."""
        return min(self.flags / self.failures, 1.0) if self.failures else 0.0


def curve(watched: Sequence[TrackedClip], person: OperatorProfile) -> list[RecallPoint]:
    """Return what is foreseen from each of the risks on in clips that nobody helped with."""
    return [_point(watched, person, FlagSettings(per_minute=_MANY, risk=risk)) for risk in RISKS]


def _point(watched: Sequence[TrackedClip], person: OperatorProfile, settings: FlagSettings) -> RecallPoint:
    flags = foreseen = 0
    desk = FlagSelector(settings, watched[0].clip.fps)
    for it in watched:
        desk.begin()
        raised = _raised(it, desk)
        flags += len(raised)
        for failure in it.failures:
            about = [k for k in raised if tells(k[1], k[0], failure, it.clip.fps, person)]
            foreseen += bool(about)
            for used in about[:1]:
                raised.remove(used)
    failures = sum(len(it.failures) for it in watched)
    return RecallPoint(settings.risk, flags, foreseen, failures, sum(it.clip.minutes for it in watched))


def _raised(watched: TrackedClip, desk: FlagSelector) -> list[tuple[int, RiskEvent]]:
    """Return the flags of a clip, each with the newest frame when it was raised."""
    windows: dict[int, list[RiskEvent]] = {}
    for newest, it in watched.troubles:
        windows.setdefault(newest, []).append(it)
    return [(newest, it) for newest, told in windows.items() for it in desk.raised(newest, told)]


def rows(points: Sequence[RecallPoint]) -> list[list[str]]:
    """Return the points as rows of a table: flags, failures, foreseen, the most that is possible."""
    return [
        [
            f"{it.risk:.2f}" if it.risk else "all",
            f"{it.flags / it.minutes:.1f}",
            f"{it.failures / it.minutes:.1f}",
            f"{it.flags / it.failures:.2f}" if it.failures else "-",
            f"{100.0 * it.share:.0f} %",
            f"{100.0 * it.bound:.0f} %",
        ]
        for it in points
    ]


def plot(points: Sequence[RecallPoint], path: Path) -> None:
    """Draw the share that is foreseen against flags a minute, below what is possible."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(7, 4))
    flags = [it.flags / it.minutes for it in points]
    axes.plot(flags, [100.0 * it.bound for it in points], color="0.6", label="one failure for each flag")
    axes.plot(flags, [100.0 * it.share for it in points], marker="o", label="foreseen")
    axes.axvline(
        points[0].failures / points[0].minutes, color="0.6", linestyle=":", label="failures a minute"
    )
    axes.set(xlabel="flags a minute", ylabel="failures foreseen, %", ylim=(0, 105))
    axes.legend(loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
