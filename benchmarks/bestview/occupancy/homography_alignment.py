"""Alignment of inexact homographies: the ground is shifted until the cameras' foot points agree."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from benchmarks.bestview.camera_tracks import Rows
from bestview import foot_points, to_ground
from bestview.geometry.ground_plane import feet_cut_off
from tracking.boxes import Floats
from tracking.motchallenge import MotRow

_GATE = 0.5
"""Largest distance, in person heights, of two cameras' foot points of one person."""
_ROUNDS = 5
_MIN_PAIRS = 20


def align_homographies(
    boxes: Rows, ground: Mapping[str, Floats], heights: Mapping[str, int], person: float
) -> dict[str, Floats]:
    """Return the homographies, each with its ground shifted; the shifts sum to zero.

    Mutually nearest foot points of two cameras in a frame are assumed to be one person. The shifts fit the
    median difference of each pair of cameras by least squares.

    Args:
        boxes: each camera's detections.
        ground: each camera's homography (3, 3) from its picture to the ground.
        heights: of each camera's picture, pixels.
        person: a person's height in ground units.
    """
    cameras = list(ground)
    foot_points_by_camera = {
        camera: _foot_points(boxes[camera], ground[camera], heights[camera]) for camera in cameras
    }
    shifts: Floats = np.zeros((len(cameras), 2))
    for _ in range(_ROUNDS):
        rows, targets = [], []
        for one, other in combinations(range(len(cameras)), 2):
            pairs = _pairs(
                foot_points_by_camera[cameras[one]],
                foot_points_by_camera[cameras[other]],
                shifts[one] - shifts[other],
                _GATE * person,
            )
            if len(pairs) < _MIN_PAIRS:
                continue
            root = np.sqrt(len(pairs))
            row = np.zeros(len(cameras))
            row[one], row[other] = root, -root
            rows.append(row)
            targets.append(-root * np.median(pairs, axis=0))
        if rows:
            # The minimum-norm solution: shifts of cameras that share ground sum to zero.
            shifts = np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)[0]
    aligned = {}
    for camera, (x, y) in zip(cameras, shifts, strict=True):
        aligned[camera] = np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]) @ ground[camera]
    return aligned


def _foot_points(rows: list[MotRow], homography: Floats, height: int) -> dict[int, Floats]:
    """Return the foot points (K, 2) on the ground by frame."""
    if not rows:
        return {}
    boxes = np.array([row.box for row in rows])
    places = to_ground(homography, foot_points(boxes))
    places[feet_cut_off(boxes, height)] = np.nan
    frames = np.array([row.frame for row in rows])
    known = np.isfinite(places).all(axis=1)
    return {int(frame): places[known & (frames == frame)] for frame in np.unique(frames)}


def _pairs(one: Mapping[int, Floats], other: Mapping[int, Floats], shift: Floats, gate: float) -> Floats:
    """Return the differences (P, 2) of mutually nearest foot points within the gate, after a shift."""
    pairs = [np.empty((0, 2))]
    for frame in sorted(one.keys() & other.keys()):
        differences = one[frame][:, None] - other[frame][None]
        if not differences.size:
            continue
        distance = np.linalg.norm(differences + shift, axis=2)
        first, second = distance.argmin(axis=1), distance.argmin(axis=0)
        mutual = [row for row, column in enumerate(first) if second[column] == row]
        near = [row for row in mutual if distance[row, first[row]] <= gate]
        pairs.append(differences[near, first[near]])
    return np.concatenate(pairs)
