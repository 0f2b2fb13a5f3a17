"""Multi-camera reference tracker: an occupancy map of the ground in each frame, and shortest paths over it.

MyView tracks in each camera and associates the tracks; here people are detected on the ground directly, from
the same foreground: `occupancy_map`, then `shortest_paths`, then `appearance_association`. It is offline:
heights and all frames are known before the first path is computed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.bestview.camera_tracks import Rows
from benchmarks.bestview.occupancy.appearance_association import MeetingSettings, PathAppearance, assign_ids
from benchmarks.bestview.occupancy.color_histograms import path_histograms
from benchmarks.bestview.occupancy.floor_grid import CameraView, FloorGrid, GridSettings, Ints, build_grid
from benchmarks.bestview.occupancy.foreground_masks import ForegroundMasks, compute_masks
from benchmarks.bestview.occupancy.ground_trajectories import (
    GroundTrajectory,
    TrajectorySettings,
    rows_of,
    trajectory_of,
)
from benchmarks.bestview.occupancy.homography_alignment import align_homographies
from benchmarks.bestview.occupancy.occupancy_map import ForegroundObservation, OccupancyMap, OccupancySettings
from benchmarks.bestview.occupancy.shortest_paths import Lattice, shortest_paths
from benchmarks.bestview.scenes import BenchmarkScene
from server.config.site_config import Config
from tracking.boxes import Floats
from tracking.motchallenge import MotRow

_UNIT = 1000.0
"""Costs are integers, in thousandths."""


@dataclass(frozen=True, slots=True)
class PathSettings:
    """The costs of paths.

    Attributes:
        doubt: probabilities are clipped to this distance from 0 and 1, which bounds the weight of one frame.
        gate_cost: of entering, and of leaving, at the border of the visible ground.
        inside_cost: likewise anywhere else, which the paper does not allow.
    """

    doubt: float = 0.001
    gate_cost: float = 40.0
    inside_cost: float = 100.0


@dataclass(frozen=True, slots=True)
class ReferenceSettings:
    """The settings of all stages."""

    floor: GridSettings = field(default_factory=GridSettings)
    map: OccupancySettings = field(default_factory=OccupancySettings)
    paths: PathSettings = field(default_factory=PathSettings)
    meetings: MeetingSettings = field(default_factory=MeetingSettings)
    trajectories: TrajectorySettings = field(default_factory=TrajectorySettings)


def track_by_occupancy(
    scene: BenchmarkScene, boxes: Rows, settings: ReferenceSettings | None = None
) -> dict[str, list[MotRow]]:
    """Track people with the occupancy map; return their boxes in every camera by id.

    Args:
        scene: with pictures and homographies.
        boxes: the cameras' confident detections, by which the homographies are aligned.
        settings: of all stages.

    Raises:
        CannotMapError: a camera has no foreground masks.
    """
    settings, config = settings or ReferenceSettings(), scene.config()
    masks = {camera: compute_masks(config, camera) for camera in scene.gt}
    views = aligned_views(masks, scene.homographies, boxes)
    floor = build_grid(list(views.values()), settings.floor)
    q = occupancy(floor, list(masks.values()), settings.map)
    reach = round(settings.trajectories.smooth_s * config.site.fps)
    paths = shortest_paths(lattice_of(floor, q, settings.paths))
    trajectories = [trajectory_of(floor, q, path, reach) for path in paths]
    appearances = appearances_of(config, masks, views, trajectories, settings.floor.aspect)
    numbers = assign_ids(appearances, floor.person, settings.meetings)
    return {
        camera: rows_of(view, trajectories, numbers, settings.trajectories) for camera, view in views.items()
    }


def aligned_views(
    masks: Mapping[str, ForegroundMasks], ground: Mapping[str, Floats], boxes: Rows
) -> dict[str, CameraView]:
    """Return the cameras' geometry, with aligned homographies."""
    views = {
        camera: CameraView(ground[camera], mask.size, mask.height_model, mask.weight)
        for camera, mask in masks.items()
    }
    person = float(np.median([view.person() for view in views.values()]))
    aligned = align_homographies(
        boxes, ground, {camera: view.size[1] for camera, view in views.items()}, person
    )
    return {camera: replace(view, homography=aligned[camera]) for camera, view in views.items()}


def occupancy(floor: FloorGrid, masks: Sequence[ForegroundMasks], settings: OccupancySettings) -> Floats:
    """Return the probability (T, L) of a person at each place in each frame."""
    mapping = OccupancyMap(floor.rectangles, settings)
    frames = max(len(mask.foreground) for mask in masks)
    q = np.empty((frames, len(floor.places)))
    for frame in range(frames):
        q[frame] = mapping.compute([_observation(mask, frame) for mask in masks])
    return q


def lattice_of(floor: FloorGrid, q: Floats, settings: PathSettings) -> Lattice:
    """Build the paper's network: being at a place costs `-log(q / (1 - q))`."""
    clipped = np.clip(q, settings.doubt, 1.0 - settings.doubt)
    gates = np.where(floor.gates, settings.gate_cost, settings.inside_cost)
    return Lattice(_as_integers(-np.log(clipped / (1.0 - clipped))), floor.moves, _as_integers(gates))


def appearances_of(
    config: Config,
    masks: Mapping[str, ForegroundMasks],
    views: Mapping[str, CameraView],
    trajectories: Sequence[GroundTrajectory],
    aspect: float,
) -> list[PathAppearance]:
    """Return the appearance in all cameras along each trajectory."""
    firsts = [trajectory.first for trajectory in trajectories]
    by_camera = []
    for camera, view in views.items():
        boxes = [view.boxes(trajectory.places, aspect) for trajectory in trajectories]
        by_camera.append(path_histograms(config, camera, masks[camera], firsts, boxes))
    return [
        PathAppearance(
            trajectory.first,
            trajectory.places,
            np.stack([histograms[place] for histograms, _ in by_camera], axis=1),
            np.stack([pixels[place] for _, pixels in by_camera], axis=1),
        )
        for place, trajectory in enumerate(trajectories)
    ]


def _observation(masks: ForegroundMasks, frame: int) -> ForegroundObservation:
    """Return a frame's foreground; shadows and missing frames have weight zero."""
    foreground = masks.foreground[frame] if frame < len(masks.foreground) else None
    shadow = masks.shadow[frame] if frame < len(masks.shadow) else None
    if foreground is None or shadow is None:
        return ForegroundObservation(np.zeros_like(masks.weight), np.zeros_like(masks.weight))
    return ForegroundObservation(foreground / 255.0, masks.weight * (1.0 - shadow / 255.0))


def _as_integers(costs: Floats) -> Ints:
    return np.asarray(np.rint(_UNIT * costs), dtype=np.int64)
