"""The table of trackers as bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tracking.evaluation import Scores

_PANELS = (("hota", "HOTA, %"), ("idf1", "IDF1, %"), ("switches", "identity switches"))
_WIDTH = 0.8
"""Width of a sequence's bars; the rest is the gap to the next."""

_CEILING = "0.8"
"""Gray: it is no tracker."""


def plot(table: dict[str, dict[str, Scores]], ceiling: str, path: Path) -> None:
    """Draw HOTA, IDF1 and switches: a group of bars for each sequence, the upper bound pale."""
    from matplotlib import pyplot as plt  # noqa: PLC0415 — after the backend is chosen

    fullest_first = sorted(
        table.values(), key=len, reverse=True
    )  # a tracker that is missing in some sequences keeps its place
    trackers = list(dict.fromkeys(name for found in fullest_first for name in found))
    figure, axes = plt.subplots(len(_PANELS), 1, figsize=(11, 9), sharex=True)
    places = np.arange(len(table))
    wide = _WIDTH / len(trackers)
    for axis, (score, label) in zip(axes, _PANELS, strict=True):
        percent = 1.0 if score == "switches" else 100.0
        for index, tracker in enumerate(trackers):
            values = [
                percent * getattr(found[tracker], score) if tracker in found else np.nan
                for found in table.values()
            ]
            color = _CEILING if tracker == ceiling else None
            axis.bar(places + (index + 0.5) * wide - _WIDTH / 2, values, wide, label=tracker, color=color)
        axis.set(ylabel=label)
        axis.grid(axis="y", alpha=0.3)
    axes[0].legend(ncols=4, fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0))
    axes[-1].set_xticks(places, list(table))
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
