"""Draws the floor plan: each camera's coverage, the foot points, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from bestview import to_ground
from bestview.calibration import Floats
from server.service.calibration.floor_plan_camera import FloorPlanCamera

_COLORS = ("#1b7f5c", "#c8501e", "#4a5fc1", "#a8327d", "#8a7a10", "#2b8fb3", "#7b4a2b", "#555555")
_INCHES = 9.0
_MARGIN = 0.08
_MAX_POINTS = 4000


def plot_floor_plan(views: Sequence[FloorPlanCamera], unit: str, out: Path | BinaryIO) -> None:
    """Draw the plan, as PNG: an area and points for each camera, a line from each point to its place."""
    floors = sorted({view.floor for view in views})
    figure = Figure(figsize=(_INCHES, _INCHES * len(floors)), layout="tight")
    FigureCanvasAgg(figure)
    for axis, floor in zip(figure.subplots(len(floors), 1, squeeze=False)[:, 0], floors, strict=True):
        for number, view in enumerate(views):
            if view.floor == floor:
                _draw(axis, view, _COLORS[number % len(_COLORS)])
        axis.set_aspect("equal")
        axis.margins(_MARGIN)
        axis.autoscale_view()
        axis.set_xlabel(_escape(unit))
        axis.set_ylabel(_escape(unit))
        axis.legend(title="camera", markerscale=3)
    figure.suptitle("Floor plan: coverage, foot points and their errors", fontsize="medium")
    figure.savefig(out, dpi=100, format="png", bbox_inches="tight", metadata={"Software": None})


def _draw(axis: Axes, view: FloorPlanCamera, color: str) -> None:
    step = -(-len(view.image_points) // _MAX_POINTS)
    mapped = to_ground(view.homography, view.image_points[::step])
    axis.fill(*_area(view).T, facecolor=to_rgba(color, 0.12), edgecolor=color, linewidth=1)
    lines = np.stack([mapped, view.floor_points[::step]], axis=1)
    axis.add_collection(LineCollection(list(lines), colors=color, linewidths=0.6, alpha=0.6))
    axis.plot(*mapped.T, ".", markersize=3, color=color, label=_escape(view.camera))


def _escape(text: str) -> str:
    """Escape a text for Matplotlib, which reads formulas between dollar signs."""
    return text.replace("$", r"\$")


def _area(view: FloorPlanCamera) -> Floats:
    """Return the outline of the points, (K, 2): convex in the picture, and so on the floor."""
    outline = cv2.convexHull(view.image_points.astype(np.float32)).reshape(-1, 2)
    return to_ground(view.homography, outline.astype(np.float64))
