"""A plot of when pictures arrived around each fault, colored by camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.faults.outcomes.fault_run import FaultOutcome
from benchmarks.faults.video.stamped_views import CAMERAS

_COLORS = ("tab:blue", "tab:orange", "tab:green")
_ROW_INCHES = 0.35


def draw(outcomes: Sequence[FaultOutcome], path: Path) -> None:
    """Draw a line per fault and viewer; time counts from when the fault began."""
    lines = [(outcome, received) for outcome in outcomes for received in outcome.received]
    if not lines:
        return
    figure = Figure(figsize=(10, 1.2 + _ROW_INCHES * len(lines)), layout="constrained")
    axes = figure.subplots()
    for row, (outcome, received) in enumerate(lines):
        for camera, color in zip(CAMERAS, _COLORS, strict=True):
            moments = np.array([at for at, shown in received.fresh if shown == camera]) - outcome.began
            label = camera if row == 0 else None
            axes.scatter(moments, np.full(len(moments), row), s=8, color=color, label=label)
        axes.plot([outcome.until - outcome.began], [row], marker="|", color="gray")
    axes.axvline(0.0, color="red", linewidth=1)
    axes.set_yticks(range(len(lines)), [outcome.fault.name for outcome, _ in lines])
    axes.invert_yaxis()
    axes.set_xlabel("seconds since the fault began; each mark is a GOP that a viewer received")
    axes.legend(loc="lower right", title="camera")
    figure.savefig(path, dpi=100)
