"""Plots of a rendering: cameras chosen for each person (the paper's Fig. 26), and tracks (Fig. 18)."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tracking.motchallenge import read_rows

_ROW_INCHES, _WIDTH_INCHES = 0.9, 11.0


def plot_choices(choices: Path, cameras: Sequence[str], out: Path) -> None:
    """Plot the chosen camera over the frames, one row per object."""
    shown: dict[int, list[tuple[int, int]]] = defaultdict(list)
    with choices.open(encoding="ascii", newline="") as file:
        for row in csv.DictReader(file):
            shown[int(row["object"])].append((int(row["frame"]), cameras.index(row["camera"])))
    rows = max(1, len(shown))
    size = (_WIDTH_INCHES, 1 + _ROW_INCHES * rows)
    figure = new_figure(size)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    for axis, (number, points) in zip(axes[:, 0], sorted(shown.items()), strict=False):
        frames, views = np.array(points).T
        axis.plot(frames, views, ".", markersize=2, color="#2a7f3f")
        axis.set_yticks(range(len(cameras)), cameras)
        axis.set_ylim(-0.5, len(cameras) - 0.5)
        axis.set_ylabel(f"object {number}")
    axes[-1, 0].set_xlabel("frame")
    figure.suptitle("Camera chosen for each object")
    save_figure(figure, out)


def plot_tracks(tracks: Path, out: Path) -> None:
    """Plot the center of each person's box over the frames, x above y."""
    figure = new_figure((_WIDTH_INCHES, 6))
    axes = figure.subplots(2, 1, sharex=True)
    places: dict[int, list[tuple[float, float, float]]] = defaultdict(list)
    for row in read_rows(tracks):
        places[row.id].append((row.frame, row.left + row.width / 2, row.top + row.height / 2))
    for number, points in sorted(places.items()):
        frames, x, y = np.array(points).T
        for axis, values in zip(axes, (x, y), strict=True):
            axis.plot(frames, values, ".", markersize=2, label=str(number))
    for axis, name in zip(axes, ("x, pixels", "y, pixels"), strict=True):
        axis.set_ylabel(name)
    if places:
        axes[0].legend(title="object", loc="upper right", markerscale=4, ncols=4, fontsize="small")
    axes[1].set_xlabel("frame")
    figure.suptitle(f"Tracks of {tracks.stem}")
    save_figure(figure, out)


def new_figure(size: tuple[float, float]) -> Figure:
    """Return an empty figure that needs no screen and has no reference in pyplot."""
    figure = Figure(figsize=size, layout="tight")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, out: Path) -> None:
    """Write a figure as PNG, reproducibly."""
    figure.savefig(out, dpi=100, metadata={"Software": None})
