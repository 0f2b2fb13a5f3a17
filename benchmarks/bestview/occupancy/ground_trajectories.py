"""From paths over the grid to walks on the ground, and to boxes in the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.bestview.occupancy.floor_grid import CameraView, FloorGrid, Ints
from benchmarks.bestview.occupancy.shortest_paths import GridPath
from tracking.boxes import Floats
from tracking.motchallenge import MotRow

_LEAST = 1e-9
"""Weight of the path's own place, so that there is always one."""


@dataclass(frozen=True, slots=True)
class TrajectorySettings:
    """How places become boxes.

    Attributes:
        smooth_s: seconds over which places are averaged, on either side.
        aspect: width of a box over its height: of all that somebody shows, arms and steps, where the map's
            rectangle has only what they always fill.
        least_seen: the share of a box that has to be in the picture.
    """

    smooth_s: float = 0.5
    aspect: float = 0.4
    least_seen: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class GroundTrajectory:
    """Where one person is: (F, 2) ground units, from the frame `first` on."""

    first: int
    places: Floats


def walk_of(floor: FloorGrid, q: Floats, path: GridPath, reach: int) -> GroundTrajectory:
    """Return a walk: places averaged over `reach` frames around, weighted by likelihood."""
    frames = path.first + np.arange(len(path.places))
    around = floor.moves[path.places]
    there = around < len(floor.places)
    near = np.where(there, around, 0)
    weight = np.where(there, q[frames[:, None], near], 0.0)
    weight += _LEAST * (near == path.places[:, None])
    places = (weight[..., None] * floor.places[near]).sum(axis=1) / weight.sum(axis=1)[:, None]
    return GroundTrajectory(path.first, smoothed(np.asarray(places), reach))


def smoothed(places: Floats, reach: int) -> Floats:
    """Return the mean of the places (F, 2) so many frames around each, fewer towards the ends."""
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(places, axis=0)])
    here = np.arange(len(places))
    near = np.minimum(reach, np.minimum(here, len(places) - 1 - here))
    return np.asarray((sums[here + near + 1] - sums[here - near]) / (2 * near + 1)[:, None])


def rows_of_walks(
    view: CameraView, walks: Sequence[GroundTrajectory], numbers: Sequence[Ints], settings: TrajectorySettings
) -> list[MotRow]:
    """Return all boxes of a camera by person and frame, cut at the borders of the picture."""
    width, height = view.size
    rows = []
    for walk, number in zip(walks, numbers, strict=True):
        boxes = view.boxes(walk.places, settings.aspect)
        whole = np.clip(np.nan_to_num(boxes), 0.0, [width, height, width, height])
        area = np.nan_to_num((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]), nan=np.inf)
        inside = (whole[:, 2] - whole[:, 0]) * (whole[:, 3] - whole[:, 1])
        for place in np.flatnonzero((inside > 0.0) & (inside >= settings.least_seen * area)).tolist():
            left, top, right, bottom = whole[place].tolist()
            frame = walk.first + place + 1
            rows.append(MotRow(frame, int(number[place]), left, top, right - left, bottom - top))
    return sorted(rows, key=lambda row: (row.frame, row.id))
