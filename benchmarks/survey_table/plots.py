"""Table 1 as bars: a row for each tracker, a panel for each column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.survey_table.measured_row import REAL_TIME, TrackerRow, ViewMeasurement, combine

_WIDTH = 0.8


def plot(table: Mapping[str, Sequence[ViewMeasurement]], path: Path) -> None:
    """Draw survived occlusions, identities, targets and speed of each tracker, over all views."""
    rows: dict[str, TrackerRow] = {name: combine(found) for name, found in table.items()}
    panels = (
        ("occlusions survived, %", [100 * row.survival_rate for row in rows.values()]),
        ("IDF1, %", [100 * row.idf1 for row in rows.values()]),
        (
            "people with a correct box, of those present, %",
            [100 * row.tracked / row.present for row in rows.values()],
        ),
        (f"times {REAL_TIME:.0f} fps, slowest view", [row.lowest_fps / REAL_TIME for row in rows.values()]),
    )
    figure = Figure(figsize=(12, 0.7 + 0.42 * len(rows)))
    axes = figure.subplots(1, len(panels), sharey=True)
    places = np.arange(len(rows))
    for axis, (label, values) in zip(axes, panels, strict=True):
        axis.barh(places, values, _WIDTH)
        axis.set(xlabel=label)
        axis.grid(axis="x", alpha=0.3)
    axes[-1].set_xscale("log")
    axes[-1].axvline(1.0, color="red", linewidth=1)
    axes[0].set_yticks(places, list(rows))
    axes[0].invert_yaxis()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
