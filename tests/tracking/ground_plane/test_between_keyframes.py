"""Joint tracking solves a program for some frames only; the others have people, boxes and detections, too."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views, true_ids
from tracking import Detections, create_solver
from tracking.boxes import Floats, iou
from tracking.ground_plane import GroundFrame, GroundPlaneTracker, GroundSettings, track_ground_plane

VIEWS = floor_views()
CAMERAS = {name: view.camera for name, view in VIEWS.items()}
SECONDS = 4.0


def walks_at(fps: float) -> Floats:
    """Return the places of two people who pass each other, in every frame, (F, 2, 2)."""
    shares = np.arange(round(SECONDS * fps))[:, None] / (SECONDS * fps)
    return np.stack([[2.0, 4.0] + shares * [5.0, 1.0], [7.5, 6.0] + shares * [-5.0, -0.5]], axis=1)


def track(
    fps: float, frames: Mapping[int, Mapping[str, Detections]] | list[dict[str, Detections]]
) -> list[GroundFrame]:
    tracker = GroundPlaneTracker(CAMERAS, GroundSettings(), create_solver("arcs"), fps)
    numbered = frames.items() if isinstance(frames, Mapping) else enumerate(frames)
    return track_ground_plane(tracker, numbered)


@pytest.mark.parametrize("fps", [60.0, 25.0, 12.5, 8.0, 3.0, 2.0])
def test_people_keep_one_id_at_any_frame_rate(fps: float) -> None:
    walks = walks_at(fps)
    frames = track(fps, detect_walkers(walks, VIEWS, FloorNoise(missed=0.1, deviation=0.01)))
    assert [frame.frame for frame in frames] == list(range(len(walks)))
    assert [len(ids) for ids in true_ids(frames, walks)] == [1, 1]


def test_every_detection_of_a_person_is_named_in_its_frame() -> None:
    walks = walks_at(25.0)
    detections = detect_walkers(walks, VIEWS, FloorNoise(deviation=0.01))
    for frame in track(25.0, detections)[25:-5]:
        assert len(frame.tracks) == 2
        for camera in CAMERAS:
            boxes = [track.boxes[camera] for track in frame.tracks]
            assert sorted(box.detection for box in boxes if box.detection is not None) == [0, 1]
            for box in boxes:
                assert (box.box == detections[frame.frame][camera].boxes[box.detection]).all()


def test_boxes_of_frames_that_nobody_searched_follow_from_those_around() -> None:
    walks = walks_at(25.0)
    found = detect_walkers(walks, VIEWS, FloorNoise())
    searched = {frame: part for frame, part in enumerate(found) if frame % 5 == 0}
    sizes_known = 80
    for frame in track(25.0, searched)[sizes_known:-6]:
        for shown in frame.tracks:
            person = int(np.linalg.norm(walks[frame.frame] - shown.place, axis=1).argmin())
            assert len(shown.boxes) == len(CAMERAS)
            for camera, box in shown.boxes.items():
                assert (box.detection is not None) == (frame.frame in searched)
                assert iou(box.box, VIEWS[camera].box(walks[frame.frame, person])) > 0.6


def test_cameras_that_search_different_frames_see_the_same_people() -> None:
    walks = walks_at(25.0)
    found = detect_walkers(walks, VIEWS, FloorNoise())
    offsets = dict(zip(CAMERAS, range(len(CAMERAS)), strict=True))
    searched = {
        frame: {camera: part[camera] for camera in part if frame % 3 == offsets[camera]}
        for frame, part in enumerate(found)
    }
    frames = track(25.0, searched)
    assert [len(ids) for ids in true_ids(frames, walks)] == [1, 1]
    for frame in frames[30:-6]:
        for shown in frame.tracks:
            named = {camera for camera, box in shown.boxes.items() if box.detection is not None}
            assert named == {camera for camera in CAMERAS if frame.frame % 3 == offsets[camera]}


def test_frames_that_are_not_final_are_shown_up_to_the_last_one() -> None:
    walks = walks_at(25.0)
    tracker = GroundPlaneTracker(CAMERAS, GroundSettings(), create_solver("arcs"), 25.0)
    for number, found in enumerate(detect_walkers(walks, VIEWS, FloorNoise())):
        final = tracker.push(number, found)
        if not final:
            continue
        ahead = tracker.provisional()
        assert tracker.first_open == final[-1].frame + 1
        assert [frame.frame for frame in ahead] == list(range(final[-1].frame + 1, number + 1))
        if number > 50:
            assert all(len(frame.tracks) == 2 for frame in ahead)
            boxes = [box for shown in ahead[-1].tracks for box in shown.boxes.values()]
            assert all(box.detection is not None for box in boxes)
