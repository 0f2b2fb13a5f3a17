"""People keep their ids where calibrations disagree, and where a camera does not see their feet."""

from __future__ import annotations

import numpy as np
import pytest

from fakes.tracking.walked_floor import FPS, FloorNoise, detect_walkers, floor_views, true_ids
from tracking import Detections, create_solver
from tracking.boxes import Floats
from tracking.ground_plane import (
    GroundCamera,
    GroundFrame,
    GroundPlaneTracker,
    GroundSettings,
    track_ground_plane,
)

VIEWS = floor_views()
TWO = {name: view.camera for name, view in VIEWS.items() if name != "c2"}
NOISE = FloorNoise(missed=0.05, deviation=0.01)


def track(cameras: dict[str, GroundCamera], found: list[dict[str, Detections]]) -> list[GroundFrame]:
    seen = [{name: frame[name] for name in cameras} for frame in found]
    tracker = GroundPlaneTracker(cameras, GroundSettings(), create_solver("columns"), FPS)
    return track_ground_plane(tracker, enumerate(seen))


def two_abreast(frames: int, apart: float) -> Floats:
    """Return two people who walk around the floor side by side, and apart at the beginning, (F, 2, 2)."""
    angles = np.linspace(0.0, 4.0 * np.pi, frames)
    radii = 2.0 + np.array([0.0, 1.0]) * np.linspace(2.5, apart, frames)[:, None]
    return 5.0 + radii[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_people_side_by_side_stay_who_they_are_though_calibrations_disagree(seed: int) -> None:
    walks = two_abreast(300, apart=0.8)
    wrong = {"c0": TWO["c0"].shifted(np.array([0.35, 0.0])), "c1": TWO["c1"].shifted(np.array([-0.35, 0.0]))}
    ids = true_ids(track(wrong, detect_walkers(walks, VIEWS, NOISE, seed)), walks)
    assert [len(found) for found in ids] == [1, 1], ids


def without_feet(found: Detections, share: float) -> Detections:
    """Return the detections with boxes that end above the feet, by a share of their height."""
    boxes = found.boxes.copy()
    boxes[:, 3] -= share * (boxes[:, 3] - boxes[:, 1])
    return Detections(boxes, found.scores, found.histograms)


@pytest.mark.parametrize("seed", range(3))
def test_somebody_whose_feet_only_one_camera_sees_wrong_for_seconds_keeps_their_id(seed: int) -> None:
    walks = np.full((60, 1, 2), 5.0) + np.linspace(0.0, 1.0, 60)[:, None, None]
    found = detect_walkers(walks, VIEWS, FloorNoise(deviation=0.01), seed)
    for frame in found[20:40]:
        frame["c0"], frame["c1"] = without_feet(frame["c0"], 0.25), Detections.empty(0)
    ids = {track.id for frame in track(TWO, found) for track in frame.tracks}
    assert ids == {1}
