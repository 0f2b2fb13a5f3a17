"""A reference for several cameras: an occupancy map of the ground in each frame, and shortest paths over it.

Beside MyView, which tracks in each camera and joins, everybody is found on the ground at once, from the same
foreground; see `occupancy_map` and `occupancy_paths`. Nothing of it is live: heights and all frames are known
before the first path is found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.bestview_cases import Case
from benchmarks.bestview_watch import Rows
from benchmarks.occupancy_floor import Floor, FloorSettings, View, lay_out
from benchmarks.occupancy_level import levelled
from benchmarks.occupancy_map import OccupancyMap, OccupancySettings, Sight
from benchmarks.occupancy_masks import Masks, masks_of
from benchmarks.occupancy_paths import NOWHERE, Lattice, Path, shortest_paths
from server.view.decide import homographies
from tracking.boxes import Floats
from tracking.motchallenge import MotRow

_UNIT = 1000.0
"""Costs are whole numbers of thousandths."""


@dataclass(frozen=True, slots=True)
class PathSettings:
    """What paths cost.

    Attributes:
        doubt: no probability is taken to be nearer to 0 or 1: it is what a frame can say at most.
        gate_cost: of coming, and of going, where what is seen ends.
        inside_cost: the same anywhere else; the paper allows it nowhere.
        smooth_s: seconds over which places are averaged, on either side.
        least_seen: the share of somebody that has to be in a picture for a box there.
    """

    doubt: float = 0.001
    gate_cost: float = 40.0
    inside_cost: float = 100.0
    smooth_s: float = 0.2
    least_seen: float = 0.3


@dataclass(frozen=True, slots=True)
class Settings:
    """All of it."""

    floor: FloorSettings = field(default_factory=FloorSettings)
    map: OccupancySettings = field(default_factory=OccupancySettings)
    paths: PathSettings = field(default_factory=PathSettings)
    level: bool = True
    """Shift the homographies first until the cameras' feet agree."""


def occupancy_rows(case: Case, boxes: Rows, settings: Settings | None = None) -> dict[str, list[MotRow]]:
    """Give everybody's boxes in every camera by their path's number.

    Args:
        case: a scene with pictures and homographies.
        boxes: the cameras' sure detections, by which the homographies are made to agree.
        settings: of the map and the paths.

    Raises:
        CannotMapError: there is no foreground to explain.
    """
    config = case.config()
    masks = {camera: masks_of(config, camera) for camera in case.gt}
    ground = {camera: it for camera, it in homographies(config).items() if it is not None}
    return mapped(masks, ground, boxes, config.site.fps, settings or Settings())


def mapped(
    masks: Mapping[str, Masks], ground: Mapping[str, Floats], boxes: Rows, fps: float, settings: Settings
) -> dict[str, list[MotRow]]:
    """Find everybody in the cameras' foreground, `fps` frames a second."""
    views = views_of(masks, ground, boxes, settings)
    floor = lay_out(list(views.values()), settings.floor)
    q = occupancy(floor, list(masks.values()), settings.map)
    paths = shortest_paths(lattice_of(floor, q, settings.paths))
    walks = [_smoothed(_places(floor, q, path), round(settings.paths.smooth_s * fps)) for path in paths]
    return {camera: list(_boxes(view, paths, walks, settings)) for camera, view in views.items()}


def views_of(
    masks: Mapping[str, Masks], ground: Mapping[str, Floats], boxes: Rows, settings: Settings
) -> dict[str, View]:
    """Give the cameras."""
    views = {camera: View(ground[camera], it.size, it.line, it.weight) for camera, it in masks.items()}
    if not settings.level:
        return views
    person = float(np.median([view.person() for view in views.values()]))
    level = levelled(boxes, ground, {camera: it.size[1] for camera, it in views.items()}, person)
    return {camera: replace(view, homography=level[camera]) for camera, view in views.items()}


def occupancy(floor: Floor, masks: Sequence[Masks], settings: OccupancySettings) -> Floats:
    """Give the probabilities (T, L) that somebody stands at each place in each frame."""
    mapping = OccupancyMap(floor.rectangles, settings)
    frames = max(len(it.foreground) for it in masks)
    q = np.empty((frames, len(floor.places)))
    for frame in range(frames):
        q[frame] = mapping.occupied([_sight(it, frame) for it in masks])
    return q


def lattice_of(floor: Floor, q: Floats, settings: PathSettings) -> Lattice:
    """Give the paper's network: being at a place costs `-log(q / (1 - q))`."""
    sure = np.clip(q, settings.doubt, 1.0 - settings.doubt)
    costs = np.rint(-_UNIT * np.log(sure / (1.0 - sure))).astype(np.int64)
    gates = np.where(floor.gates, settings.gate_cost, settings.inside_cost)
    priced = np.where(np.isfinite(gates), np.rint(_UNIT * np.nan_to_num(gates, posinf=0.0)), float(NOWHERE))
    return Lattice(costs, floor.moves, priced.astype(np.int64))


def _sight(masks: Masks, frame: int) -> Sight:
    """Give a frame's foreground; shadows tell nothing, and neither does a frame that is not there."""
    one = masks.foreground[frame] if frame < len(masks.foreground) else None
    other = masks.shadow[frame] if frame < len(masks.shadow) else None
    if one is None or other is None:
        return Sight(np.zeros_like(masks.weight), np.zeros_like(masks.weight))
    return Sight(one / 255.0, masks.weight * (1.0 - other / 255.0))


def _places(floor: Floor, q: Floats, path: Path) -> Floats:
    """Give where somebody is (F, 2): the mean of their place and those around it, by how likely they are."""
    frames = path.first + np.arange(len(path.places))
    around = floor.moves[path.places]
    there = around < len(floor.places)
    near = np.where(there, around, 0)
    weight = np.where(there, q[frames[:, None], near], 0.0) + 1e-9 * (near == path.places[:, None])
    return np.asarray((weight[..., None] * floor.places[near]).sum(axis=1) / weight.sum(axis=1)[:, None])


def _smoothed(places: Floats, reach: int) -> Floats:
    """Give the mean of the places (F, 2) so many frames around each, fewer towards the ends."""
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(places, axis=0)])
    here = np.arange(len(places))
    near = np.minimum(reach, np.minimum(here, len(places) - 1 - here))
    return np.asarray((sums[here + near + 1] - sums[here - near]) / (2 * near + 1)[:, None])


def _boxes(view: View, paths: Sequence[Path], walks: Sequence[Floats], settings: Settings) -> list[MotRow]:
    """Give everybody's boxes in a camera, cut at the borders of its picture."""
    width, height = view.size
    rows = []
    for number, (path, walk) in enumerate(zip(paths, walks, strict=True), start=1):
        boxes = view.boxes(walk, settings.floor.aspect)
        whole = np.clip(np.nan_to_num(boxes), 0.0, [width, height, width, height])
        area = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
        inside = (whole[:, 2] - whole[:, 0]) * (whole[:, 3] - whole[:, 1])
        shown = np.isfinite(area) & (inside >= settings.paths.least_seen * np.nan_to_num(area, nan=1.0))
        for place in np.flatnonzero(shown & (inside > 0.0)):
            left, top, right, bottom = whole[place].tolist()
            rows.append(MotRow(path.first + int(place) + 1, number, left, top, right - left, bottom - top))
    return sorted(rows, key=lambda row: (row.frame, row.id))
