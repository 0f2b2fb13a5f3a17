"""Plots of objects and labels over time, as in the paper's Figs. 8, 14, 18 and 20."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.paper_experiments.label_errors import LabelErrors
from benchmarks.paper_experiments.scene import ObjectTruth
from tracking.boxes import Floats

_COLORS = ("#1b6ca8", "#2e9e4f", "#c77700", "#8d3fae")
_AXES = ("x", "y")
"""Of the boxes' top left corner."""


def plot(
    truth: ObjectTruth, followed: Mapping[str, tuple[Floats, LabelErrors]], title: str, path: Path
) -> None:
    """Draw a column for each solver: truth as pale lines, labels as dots, wrong ones as crosses."""
    figure = Figure(figsize=(5.0 * len(followed), 6.5))
    axes = figure.subplots(len(_AXES), len(followed), sharex=True, sharey="row", squeeze=False)
    frames = np.arange(truth.frames)
    for column, (solver, (boxes, labels)) in enumerate(followed.items()):
        for row, name in enumerate(_AXES):
            axis = axes[row, column]
            for k in range(truth.objects):
                color, wrong = _COLORS[k % len(_COLORS)], labels.wrong[k]
                axis.plot(frames, truth.boxes[k, :, row], color=color, linewidth=3, alpha=0.25)
                axis.plot(frames, boxes[k, :, row], ".", color=color, markersize=2, label=f"object {k}")
                axis.plot(frames[wrong], boxes[k, wrong, row], "x", color="red", markersize=4)
            axis.set(ylabel=f"{name} of the box, pixels" if column == 0 else "")
        axes[0, column].set(title=f"{solver}: {labels.wrong.sum()} wrong labels")
        axes[-1, column].set(xlabel="frame")
    axes[0, -1].legend(fontsize="small", markerscale=4, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.suptitle(f"{title} (lines: truth; dots: labels; crosses: wrong ones)", fontsize="medium")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
