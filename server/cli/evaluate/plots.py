"""Plots of scored view choices: the chosen camera over time and the optimum (the paper's Fig. 26)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from server.cli.evaluate.cut_strips import plot_strips
from server.cli.evaluate.ground_truth import SceneTruth
from server.cli.evaluate.view_scores import ViewEvaluation
from server.cli.render.plots import new_figure, save_figure
from server.cli.render.site_file import RenderedSite

_ROW_INCHES, _WIDTH_INCHES = 1.1, 11.0
_SEEN, _BEST, _CHOSEN = "#d9d9d9", "#d9822b", "#2a7f3f"
_BAR_OFFSET = 0.16
"""Vertical offset of the choice above its camera's line, and of the optimum below it."""


def plot_views(
    folder: Path,
    truth: SceneTruth,
    evaluation: ViewEvaluation,
    site_info: RenderedSite,
    videos: Mapping[str, Path],
) -> None:
    """Write `choices.png`, and with videos `person-K.png` with the frames around each cut.

    Raises:
        UserError: a video cannot be read.
    """
    rows = [row for row, person in enumerate(truth.people) if person in evaluation.people]
    figure = new_figure((_WIDTH_INCHES, 1.2 + _ROW_INCHES * len(rows)))
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axis, row in zip(axes, rows, strict=True):
        person = truth.people[row]
        _plot_person(
            axis, truth.views.visible[row], evaluation.views[row], evaluation.best[row], site_info.fps
        )
        axis.set_yticks(range(len(truth.cameras)), truth.cameras)
        axis.set_ylim(-0.5, len(truth.cameras) - 0.5)
        axis.set_ylabel(f"person {person}\nobject {evaluation.object_of.get(person, '-')}")
    axes[-1].set_xlabel("seconds")
    axes[-1].set_xlim(0.0, evaluation.views.shape[1] / site_info.fps)
    lines = [Line2D([], [], color=color, linewidth=4) for color in (_CHOSEN, _BEST, _SEEN)]
    figure.legend(lines, ["chosen", "optimum", "visible"], loc="upper right", ncols=3)
    figure.suptitle("Camera chosen for each person", x=0.3)
    save_figure(figure, folder / "choices.png")
    if videos:
        plot_strips(folder, truth, evaluation, site_info, videos)


def _plot_person(
    axis: Axes,
    visible: NDArray[np.bool_],
    views: NDArray[np.int64],
    best: NDArray[np.int64],
    fps: float,
) -> None:
    """Draw the (N, C) visibility of a person, and the (N,) chosen and optimal cameras."""
    for camera in range(visible.shape[1]):
        _bars(axis, visible[:, camera], camera - 0.35, 0.7, _SEEN, fps)
        _bars(axis, best == camera, camera - _BAR_OFFSET - 0.1, 0.2, _BEST, fps)
        _bars(axis, views == camera, camera + _BAR_OFFSET - 0.1, 0.2, _CHOSEN, fps)


def _bars(axis: Axes, on: NDArray[np.bool_], bottom: float, height: float, color: str, fps: float) -> None:
    """Draw a bar over each run of frames for which ``on`` is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    spans = [(float(begin) / fps, float(end - begin) / fps) for begin, end in edges.reshape(-1, 2)]
    axis.broken_barh(spans, (bottom, height), color=color, linewidth=0)
