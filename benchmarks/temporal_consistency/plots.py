"""Figs. 5 and 6 of Khalaf and Intille as plots: measured as lines, published as dots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import matplotlib.pyplot as plt
import numpy as np

PUBLISHED = {2: (4, 3, 0, 0, 0), 3: (54, 22, 3, 0, 0), 4: (48, 19, 17, 14, 12)}
"""Merges, and errors by window (Khalaf and Intille, Fig. 5)."""
PUBLISHED_EDGES = {2: (1, 36, 7), 3: (1, 5398, 780), 4: (1, 50047, 4290)}
"""Minimum, maximum and mean number of edges per stage (Fig. 6)."""
_COLORS = {2: "#4c72b0", 3: "#dd8452", 4: "#55a868"}


class PlottedCounts(Protocol):
    """The plotted counts of the clips with a number of people."""

    chances: int
    errors: dict[int, int]
    edges: list[int]
    unpruned: list[int]


def plot(tallies: Mapping[int, PlottedCounts], low_color: Mapping[int, PlottedCounts], path: Path) -> None:
    """Draw both figures side by side; `low_color` is of pictures with little color."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2))
    _errors(left, tallies, low_color)
    _edges(right, tallies)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _errors(axes: Any, tallies: Mapping[int, PlottedCounts], low_color: Mapping[int, PlottedCounts]) -> None:
    """Draw the share of wrong identities after a merge over the stages of the window."""
    for people, counts in tallies.items():
        shares = [100 * errors / max(counts.chances, 1) for errors in counts.errors.values()]
        axes.plot(list(counts.errors), shares, "-", color=_COLORS[people], label=f"{people} people")
        shares = [
            100 * errors / max(low_color[people].chances, 1) for errors in low_color[people].errors.values()
        ]
        axes.plot(list(counts.errors), shares, "--", color=_COLORS[people])
        merges, *published = PUBLISHED[people]
        points = [100 * errors / merges for errors in published]
        axes.plot(list(counts.errors), points, "o", color=_COLORS[people], alpha=0.6)
    axes.set_xlabel("stages of the window, half a second each")
    axes.set_ylabel("wrong identities after a merge, % of people")
    axes.set_title("Fig. 5 (dashed: little color; dots: published, % of merges)", fontsize=10)
    axes.legend()
    axes.grid(alpha=0.3)


def _edges(axes: Any, tallies: Mapping[int, PlottedCounts]) -> None:
    """Draw the edges per stage, pruned and not, as cumulative shares."""
    for people, counts in tallies.items():
        color = _COLORS[people]
        axes.plot(*_cumulative(counts.edges), "-", color=color, label=f"{people} people")
        axes.plot(*_cumulative(counts.unpruned), "--", color=color)
        _, most, mean = PUBLISHED_EDGES[people]
        axes.plot([mean, most], [0.02, 1.0], "o", color=color, alpha=0.6)
    axes.set_xscale("log")
    axes.set_xlabel("edges of a stage")
    axes.set_ylabel("cumulative share of the stages")
    axes.set_title("Fig. 6 (dashed: without pruning; dots: published mean, below, and max.)", fontsize=10)
    axes.legend()
    axes.grid(alpha=0.3)


def _cumulative(values: Sequence[int]) -> tuple[Any, Any]:
    return np.sort(values), np.arange(1, len(values) + 1) / len(values)
