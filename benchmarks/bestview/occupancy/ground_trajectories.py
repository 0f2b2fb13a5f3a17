"""Conversion of grid paths to trajectories on the ground and boxes in the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.bestview.occupancy.floor_grid import CameraView, FloorGrid, Ints
from benchmarks.bestview.occupancy.shortest_paths import GridPath
from tracking.boxes import Floats
from tracking.motchallenge import MotRow

_MIN_WEIGHT = 1e-9
"""Weight of the path's own place, so that the weights never sum to zero."""


@dataclass(frozen=True, slots=True)
class TrajectorySettings:
    """How places become boxes.

    Attributes:
        smooth_s: seconds over which places are averaged, on either side.
        aspect: width of a box over its height, with arms and steps; the map's rectangle has only the torso.
        min_visible: share of a box that must be in the picture.
    """

    smooth_s: float = 0.5
    aspect: float = 0.4
    min_visible: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class GroundTrajectory:
    """The trajectory of one person: (F, 2) ground units, from the frame `first` on."""

    first: int
    places: Floats


def trajectory_of(floor: FloorGrid, q: Floats, path: GridPath, reach: int) -> GroundTrajectory:
    """Return the trajectory of a path: places averaged over `reach` frames around, weighted by likelihood."""
    frames = path.first + np.arange(len(path.places))
    neighbors = floor.moves[path.places]
    valid = neighbors < len(floor.places)
    near = np.where(valid, neighbors, 0)
    weight = np.where(valid, q[frames[:, None], near], 0.0)
    weight += _MIN_WEIGHT * (near == path.places[:, None])
    places = (weight[..., None] * floor.places[near]).sum(axis=1) / weight.sum(axis=1)[:, None]
    return GroundTrajectory(path.first, moving_average(np.asarray(places), reach))


def moving_average(places: Floats, reach: int) -> Floats:
    """Return the moving average of places (F, 2) over `reach` frames on either side, fewer at the ends."""
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(places, axis=0)])
    here = np.arange(len(places))
    near = np.minimum(reach, np.minimum(here, len(places) - 1 - here))
    return np.asarray((sums[here + near + 1] - sums[here - near]) / (2 * near + 1)[:, None])


def rows_of(
    view: CameraView,
    trajectories: Sequence[GroundTrajectory],
    numbers: Sequence[Ints],
    settings: TrajectorySettings,
) -> list[MotRow]:
    """Return all boxes of a camera by frame and id, clipped to the picture."""
    width, height = view.size
    rows = []
    for trajectory, number in zip(trajectories, numbers, strict=True):
        boxes = view.boxes(trajectory.places, settings.aspect)
        whole = np.clip(np.nan_to_num(boxes), 0.0, [width, height, width, height])
        area = np.nan_to_num((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]), nan=np.inf)
        inside = (whole[:, 2] - whole[:, 0]) * (whole[:, 3] - whole[:, 1])
        for place in np.flatnonzero((inside > 0.0) & (inside >= settings.min_visible * area)).tolist():
            frame = trajectory.first + place + 1
            rows.append(MotRow.of_box(frame, int(number[place]), whole[place].tolist()))
    return sorted(rows, key=lambda row: (row.frame, row.id))
