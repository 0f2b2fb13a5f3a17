"""Figs. 5 and 6 of Khalaf and Intille as plots: ours as lines, theirs as dots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import matplotlib.pyplot as plt
import numpy as np

THEIRS = {2: (4, 3, 0, 0, 0), 3: (54, 22, 3, 0, 0), 4: (48, 19, 17, 14, 12)}
"""Merges, and errors by window, of their Fig. 5."""
THEIR_EDGES = {2: (1, 36, 7), 3: (1, 5398, 780), 4: (1, 50047, 4290)}
"""Least, most and mean number of edges a stage, of their Fig. 6."""
_COLOURS = {2: "#4c72b0", 3: "#dd8452", 4: "#55a868"}


class PlottedCounts(Protocol):
    """What is plotted of the clips with so many people."""

    chances: int
    errors: dict[int, int]
    edges: list[int]
    unpruned: list[int]


def plot(tallies: Mapping[int, PlottedCounts], pale: Mapping[int, PlottedCounts], path: Path) -> None:
    """Draw both figures side by side; `pale` is of pictures with little colour."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2))
    _errors(left, tallies, pale)
    _edges(right, tallies)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _errors(axes: Any, tallies: Mapping[int, PlottedCounts], pale: Mapping[int, PlottedCounts]) -> None:
    """Draw the share of people mistaken after a merge over the stages of the window."""
    for people, tally in tallies.items():
        shares = [100 * errors / max(tally.chances, 1) for errors in tally.errors.values()]
        axes.plot(list(tally.errors), shares, "-", color=_COLOURS[people], label=f"{people} people")
        shares = [100 * errors / max(pale[people].chances, 1) for errors in pale[people].errors.values()]
        axes.plot(list(tally.errors), shares, "--", color=_COLOURS[people])
        merges, *theirs = THEIRS[people]
        points = [100 * errors / merges for errors in theirs]
        axes.plot(list(tally.errors), points, "o", color=_COLOURS[people], alpha=0.6)
    axes.set_xlabel("stages of the window, half a second each")
    axes.set_ylabel("mistaken after a merge, % of people in them")
    axes.set_title("Fig. 5 (dashed: little colour; dots: theirs, % of merges)", fontsize=10)
    axes.legend()
    axes.grid(alpha=0.3)


def _edges(axes: Any, tallies: Mapping[int, PlottedCounts]) -> None:
    """Draw how many edges the stages have, pruned and not, as cumulative shares."""
    for people, tally in tallies.items():
        colour = _COLOURS[people]
        axes.plot(*_cumulative(tally.edges), "-", color=colour, label=f"{people} people")
        axes.plot(*_cumulative(tally.unpruned), "--", color=colour)
        _, most, mean = THEIR_EDGES[people]
        axes.plot([mean, most], [0.02, 1.0], "o", color=colour, alpha=0.6)
    axes.set_xscale("log")
    axes.set_xlabel("edges of a stage")
    axes.set_ylabel("share of the stages that have no more")
    axes.set_title("Fig. 6 (dashed: without pruning; dots: their mean, below, and most)", fontsize=10)
    axes.legend()
    axes.grid(alpha=0.3)


def _cumulative(values: Sequence[int]) -> tuple[Any, Any]:
    return np.sort(values), np.arange(1, len(values) + 1) / len(values)
