"""A reference for several cameras: an occupancy map of the ground in each frame, and shortest paths over it.

Beside MyView, which tracks in each camera and joins, everybody is found on the ground at once, from the same
foreground: `occupancy_map`, then `occupancy_paths`, then `occupancy_colours`. Nothing of it is live: heights
and all frames are known before the first path is found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.bestview.camera_tracks import Rows
from benchmarks.bestview.occupancy.appearance_association import MeetingSettings, PathAppearance, numbers_of
from benchmarks.bestview.occupancy.color_histograms import looks_of
from benchmarks.bestview.occupancy.floor_grid import CameraView, FloorGrid, GridSettings, Ints, lay_out
from benchmarks.bestview.occupancy.foreground_masks import ForegroundMasks, masks_of
from benchmarks.bestview.occupancy.ground_trajectories import (
    GroundTrajectory,
    TrajectorySettings,
    rows_of_walks,
    walk_of,
)
from benchmarks.bestview.occupancy.homography_alignment import levelled
from benchmarks.bestview.occupancy.occupancy_map import ForegroundObservation, OccupancyMap, OccupancySettings
from benchmarks.bestview.occupancy.shortest_paths import Lattice, shortest_paths
from benchmarks.bestview.scenes import BenchmarkScene
from server.config.site_config import Config
from server.service.view_selection.decider import camera_homographies
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
    """

    doubt: float = 0.001
    gate_cost: float = 40.0
    inside_cost: float = 100.0


@dataclass(frozen=True, slots=True)
class ReferenceSettings:
    """All of it."""

    floor: GridSettings = field(default_factory=GridSettings)
    map: OccupancySettings = field(default_factory=OccupancySettings)
    paths: PathSettings = field(default_factory=PathSettings)
    colours: MeetingSettings = field(default_factory=MeetingSettings)
    walks: TrajectorySettings = field(default_factory=TrajectorySettings)


def occupancy_rows(
    case: BenchmarkScene, boxes: Rows, settings: ReferenceSettings | None = None
) -> dict[str, list[MotRow]]:
    """Return everybody's boxes in every camera by their number.

    Args:
        case: a scene with pictures and homographies.
        boxes: the cameras' sure detections, by which the homographies are made to agree.
        settings: of all stages.

    Raises:
        CannotMapError: there is no foreground to explain.
    """
    settings, config = settings or ReferenceSettings(), case.config()
    masks = {camera: masks_of(config, camera) for camera in case.gt}
    ground = {camera: it for camera, it in camera_homographies(config).items() if it is not None}
    views = views_of(masks, ground, boxes)
    floor = lay_out(list(views.values()), settings.floor)
    q = occupancy(floor, list(masks.values()), settings.map)
    reach = round(settings.walks.smooth_s * config.site.fps)
    paths = shortest_paths(lattice_of(floor, q, settings.paths))
    walks = [walk_of(floor, q, path, reach) for path in paths]
    walkers = walkers_of(config, masks, views, walks, settings.floor.aspect)
    numbers = numbers_of(walkers, floor.person, settings.colours)
    return {camera: rows_of_walks(view, walks, numbers, settings.walks) for camera, view in views.items()}


def views_of(
    masks: Mapping[str, ForegroundMasks], ground: Mapping[str, Floats], boxes: Rows
) -> dict[str, CameraView]:
    """Return the cameras, their homographies shifted until their feet agree."""
    views = {camera: CameraView(ground[camera], it.size, it.line, it.weight) for camera, it in masks.items()}
    person = float(np.median([view.person() for view in views.values()]))
    level = levelled(boxes, ground, {camera: it.size[1] for camera, it in views.items()}, person)
    return {camera: replace(view, homography=level[camera]) for camera, view in views.items()}


def occupancy(floor: FloorGrid, masks: Sequence[ForegroundMasks], settings: OccupancySettings) -> Floats:
    """Return the probabilities (T, L) that somebody stands at each place in each frame."""
    mapping = OccupancyMap(floor.rectangles, settings)
    frames = max(len(it.foreground) for it in masks)
    q = np.empty((frames, len(floor.places)))
    for frame in range(frames):
        q[frame] = mapping.occupied([_sight(it, frame) for it in masks])
    return q


def lattice_of(floor: FloorGrid, q: Floats, settings: PathSettings) -> Lattice:
    """Return the paper's network: being at a place costs `-log(q / (1 - q))`."""
    sure = np.clip(q, settings.doubt, 1.0 - settings.doubt)
    gates = np.where(floor.gates, settings.gate_cost, settings.inside_cost)
    return Lattice(_whole(-np.log(sure / (1.0 - sure))), floor.moves, _whole(gates))


def walkers_of(
    config: Config,
    masks: Mapping[str, ForegroundMasks],
    views: Mapping[str, CameraView],
    walks: Sequence[GroundTrajectory],
    aspect: float,
) -> list[PathAppearance]:
    """Return what everybody looks like in all cameras, along their walks."""
    firsts = [walk.first for walk in walks]
    seen = []
    for camera, view in views.items():
        boxes = [view.boxes(walk.places, aspect) for walk in walks]
        seen.append(looks_of(config, camera, masks[camera], firsts, boxes))
    return [
        PathAppearance(
            walk.first,
            walk.places,
            np.stack([looks[place] for looks, _ in seen], axis=1),
            np.stack([pixels[place] for _, pixels in seen], axis=1),
        )
        for place, walk in enumerate(walks)
    ]


def _sight(masks: ForegroundMasks, frame: int) -> ForegroundObservation:
    """Return a frame's foreground; shadows tell nothing, and neither does a frame that is not there."""
    one = masks.foreground[frame] if frame < len(masks.foreground) else None
    other = masks.shadow[frame] if frame < len(masks.shadow) else None
    if one is None or other is None:
        return ForegroundObservation(np.zeros_like(masks.weight), np.zeros_like(masks.weight))
    return ForegroundObservation(one / 255.0, masks.weight * (1.0 - other / 255.0))


def _whole(costs: Floats) -> Ints:
    return np.asarray(np.rint(_UNIT * costs), dtype=np.int64)
