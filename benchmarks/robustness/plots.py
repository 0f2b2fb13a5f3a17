"""The plot of what disturbances cost."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.robustness.disturbances.catalog import STRENGTHS
from server.cli.render.plots import new_figure, save_figure

_COLORS = dict(zip(STRENGTHS, ("#9ecae1", "#3b7dd8", "#0b2f6b"), strict=True))


def plot_costs(costs: Mapping[str, Mapping[str, float]], out: Path) -> None:
    """Draw bars of the loss of joint IDF1, in points, a column for each scene.

    Args:
        costs: by scene, then by disturbance and strength.
        out: the file to write.
    """
    names = list(dict.fromkeys(title.rpartition(" ")[0] for scene in costs.values() for title in scene))
    figure = new_figure((2.0 + 3.0 * len(costs), 1.0 + 0.45 * len(names)))
    axes = figure.subplots(1, len(costs), squeeze=False, sharey=True)[0]
    places = np.arange(len(names))
    for axis, (title, scene) in zip(axes, costs.items(), strict=True):
        for offset, strength in enumerate(STRENGTHS):
            values = [scene.get(f"{name} {strength}", np.nan) for name in names]
            axis.barh(places + 0.27 * (offset - 1), values, 0.25, label=strength, color=_COLORS[strength])
        axis.axvline(5.0, color="#c0392b", linewidth=0.8)
        axis.set(title=title, xlabel="loss of joint IDF1, points", yticks=places, yticklabels=names)
    axes[0].invert_yaxis()
    axes[0].legend(fontsize="small")
    figure.tight_layout()
    out.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, out)
