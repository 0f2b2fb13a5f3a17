"""Joint tracking: people on a floor have one id in all cameras, and boxes where a camera misses them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fakes.tracking.walked_floor import FPS, FloorNoise, detect_walkers, floor_views, true_ids
from tracking import Detections, create_solver
from tracking.boxes import Floats, iou
from tracking.ground_plane import (
    GroundCamera,
    GroundFrame,
    GroundPlaneTracker,
    GroundSettings,
    keyframe_tracker,
    track_ground_plane,
)
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.program.costs import ProgramCosts
from tracking.ground_plane.program.solution import ProgramSolution, solve_by_parts, solve_program
from tracking.ground_plane.program.useful_arcs import unseen_paths, useful_arcs
from tracking.solvers.base import PartsSolver, SolveReport

VIEWS = floor_views()
CAMERAS = {name: view.camera for name, view in VIEWS.items()}
FRAMES = 40


def tracker(cameras: dict[str, GroundCamera] = CAMERAS) -> GroundPlaneTracker:
    return GroundPlaneTracker(cameras, GroundSettings(), create_solver("arcs"), FPS)


def crossing_walks(people: int = 6, seed: int = 3) -> Floats:
    """Return walks along straight lines across the floor, (F, N, 2); people stay 0.7 m apart."""
    random = np.random.default_rng(seed)
    shares = np.linspace(0.0, 1.0, FRAMES)[:, None]
    walks = np.empty((FRAMES, 0, 2))
    while walks.shape[1] < people:
        start, target = random.uniform(1.5, 8.5, (2, 2))
        walk = (start + shares * (target - start))[:, None]
        if np.linalg.norm(target - start) > 4.0 and (np.linalg.norm(walks - walk, axis=2) > 0.7).all():
            walks = np.concatenate([walks, walk], axis=1)
    return walks


def track(walks: Floats, noise: FloorNoise) -> list[GroundFrame]:
    return track_ground_plane(tracker(), enumerate(detect_walkers(walks, VIEWS, noise)))


@pytest.mark.parametrize(
    "noise",
    [
        FloorNoise(),
        FloorNoise(missed=0.1, deviation=0.006),
        FloorNoise(missed=0.1, deviation=0.02, false=0.3),
    ],
    ids=["true", "mild", "strong"],
)
def test_people_who_cross_keep_one_id_in_all_cameras(noise: FloorNoise) -> None:
    walks = crossing_walks()
    frames = track(walks, noise)
    assert [frame.frame for frame in frames] == list(range(FRAMES))
    ids = true_ids(frames, walks)
    assert all(len(found) == 1 for found in ids), ids
    assert len(set.union(*ids)) == len(ids)
    boxes = [track.boxes for frame in frames[10:] for track in frame.tracks]
    assert np.mean([len(found) for found in boxes]) > 2.9, "missed ones have boxes, too"


def test_a_person_who_is_missed_in_a_camera_has_a_box_there() -> None:
    walks = crossing_walks(2)
    detections = detect_walkers(walks, VIEWS, FloorNoise())
    for found in detections[20:]:
        found["c1"] = Detections.empty(0)
    frames = track_ground_plane(tracker(), enumerate(detections))
    for frame in frames[20:]:
        assert len(frame.tracks) == 2
        for shown in frame.tracks:
            person = int(np.linalg.norm(walks[frame.frame] - shown.place, axis=1).argmin())
            predicted = shown.boxes["c1"]
            assert predicted.detection is None
            assert iou(predicted.box, VIEWS["c1"].box(walks[frame.frame, person])) > 0.5


def test_boxes_name_their_detections() -> None:
    walks = crossing_walks(4)
    detections = detect_walkers(walks, VIEWS, FloorNoise(missed=0.2, deviation=0.006))
    for frame in track_ground_plane(tracker(), enumerate(detections)):
        for name in CAMERAS:
            found = [track.boxes[name] for track in frame.tracks if name in track.boxes]
            detected = [box for box in found if box.detection is not None]
            assert len({box.detection for box in detected}) == len(detected), "one person each"
            for box in detected:
                assert (box.box == detections[frame.frame][name].boxes[box.detection]).all()


def test_false_detections_alone_are_nobody() -> None:
    frames = track(np.full((FRAMES, 1, 2), np.nan), FloorNoise(false=0.5))
    assert sum(len(frame.tracks) for frame in frames) < 0.15 * FRAMES


def with_furniture(found: dict[str, Detections], score: float) -> dict[str, Detections]:
    """Return detections with one of a thing that never moves, in one camera."""
    boxes = np.concatenate([found["c0"].boxes, VIEWS["c0"].box(np.array([2.0, 2.0]))[None]])
    scores = np.append(found["c0"].scores, score)
    return {**found, "c0": Detections(boxes, scores, np.zeros((len(boxes), found["c0"].histograms.shape[1])))}


@pytest.mark.parametrize("score", [0.0, pytest.param(0.05, marks=pytest.mark.slow), 0.15])
def test_furniture_that_looks_a_little_like_a_person_never_becomes_one(score: float) -> None:
    nobody = [detect_walkers(np.full((1, 1, 2), np.nan), VIEWS, FloorNoise())[0]] * (10 * FRAMES)
    alone = tracker({"c0": CAMERAS["c0"]})
    furnished = ({"c0": with_furniture(found, score)["c0"]} for found in nobody)
    frames = track_ground_plane(alone, enumerate(furnished))
    assert not any(frame.tracks for frame in frames)


@pytest.mark.parametrize("seconds", [2.6, 6.0])
def test_a_known_person_is_followed_by_detections_that_are_hardly_one_for_some_seconds(
    seconds: float,
) -> None:
    walks = crossing_walks(2)
    end = 10 + round(seconds * FPS)
    detections = [
        {
            name: Detections(
                part.boxes, np.full(len(part), 0.05 if 10 <= number < end else 0.9), part.histograms
            )
            for name, part in found.items()
        }
        for number, found in enumerate(detect_walkers(walks, VIEWS, FloorNoise(deviation=0.006)))
    ]
    counts = [len(frame.tracks) for frame in track_ground_plane(tracker(), enumerate(detections))]
    left_after = 10 + round(GroundSettings().forget_unclear_after_s * FPS)
    assert counts[10:left_after] == [2] * (left_after - 10)
    assert counts[left_after + 2 :] == [2 if end < left_after else 0] * (FRAMES - left_after - 2)


def test_parts_of_people_are_seldom_somebody() -> None:
    walks = crossing_walks(3)
    detections = detect_walkers(walks, VIEWS, FloorNoise(deviation=0.006))
    random = np.random.default_rng(0)
    for found in detections:
        for name, whole in found.items():
            upper = whole.boxes[random.random(len(whole)) < 0.5].copy()
            upper[:, 3] -= 0.5 * (upper[:, 3] - upper[:, 1])
            found[name] = Detections(
                np.concatenate([whole.boxes, upper]),
                np.concatenate([whole.scores, np.full(len(upper), 0.3)]),
                np.zeros((len(whole) + len(upper), 0)),
            )
    frames = track_ground_plane(tracker(), enumerate(detections))
    assert all(len(found) == 1 for found in true_ids(frames, walks, 0.3))
    assert len({track.id for frame in frames for track in frame.tracks}) < 8, "14 without regard to covers"


def test_who_leaves_is_not_who_arrives_later() -> None:
    walks = crossing_walks(2)
    walks[15:, 0] = np.nan
    walks[:22, 1] = np.nan
    frames = track(walks, FloorNoise(deviation=0.006))
    first, second = true_ids(frames, walks)
    assert len(first) == len(second) == 1
    assert not first & second


def test_nobody_is_shown_long_after_they_left() -> None:
    walks = crossing_walks(2)
    walks[15:, 0] = np.nan
    frames = track(walks, FloorNoise(deviation=0.006))
    assert {len(frame.tracks) for frame in frames[17:]} == {1}


def test_the_unit_of_the_plane_is_found_from_the_heights_of_people() -> None:
    walks = crossing_walks()
    centimeters = {
        name: GroundCamera(np.diag([100.0, 100.0, 1.0]) @ camera.homography, camera.width, camera.height)
        for name, camera in CAMERAS.items()
    }
    detections = detect_walkers(walks, VIEWS, FloorNoise(missed=0.1, deviation=0.006))
    frames = track_ground_plane(tracker(centimeters), enumerate(detections))
    assert all(len(found) == 1 for found in true_ids(frames, 100.0 * walks, 60.0))


@pytest.mark.parametrize("lag_s", [0.2, 0.6])
def test_flows_and_parts_agree_and_prove_their_answers(lag_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    reports: list[SolveReport] = []

    def solve_twice(costs: ProgramCosts, frames: Sequence[Places], solver: PartsSolver) -> ProgramSolution:
        unseen = unseen_paths(costs)
        conflicts = [places.conflicts for places in frames]
        parts = solve_by_parts(useful_arcs(costs, unseen), conflicts, unseen, create_solver("exact"))
        found = solve_program(costs, frames, solver)
        assert found.report.objective == pytest.approx(parts.report.objective, abs=1e-6)
        reports.append(found.report)
        return found

    monkeypatch.setattr(keyframe_tracker, "solve_program", solve_twice)
    detections = detect_walkers(crossing_walks(), VIEWS, FloorNoise(0.1, 0.02, 0.3))[:20]
    online = GroundPlaneTracker(CAMERAS, GroundSettings(lag_s=lag_s), create_solver("columns"), FPS)
    assert len(track_ground_plane(online, enumerate(detections))) == 20
    assert len(reports) >= 10
    assert {report.status for report in reports} == {"optimal"}


def test_the_same_detections_give_the_same_tracks() -> None:
    detections = detect_walkers(crossing_walks(), VIEWS, FloorNoise(0.1, 0.02, 0.3))
    one, other = (track_ground_plane(tracker(), enumerate(detections)) for _ in range(2))
    for before, after in zip(one, other, strict=True):
        assert [track.id for track in before.tracks] == [track.id for track in after.tracks]
        assert all(
            (first.place == second.place).all()
            for first, second in zip(before.tracks, after.tracks, strict=True)
        )


def test_skipped_frames_are_frames_without_detections_and_after_a_long_gap_all_are_new() -> None:
    detections = detect_walkers(crossing_walks(3), VIEWS, FloorNoise())
    online = tracker()
    final = [frame for number in range(10) for frame in online.push(number, detections[number])]
    final += online.push(12, detections[12])
    known = {track.id for frame in final for track in frame.tracks}
    later = online.push(5000, detections[13]) + online.flush()
    assert [frame.frame for frame in final + later] == [*range(13), 5000]
    assert len(known) == len(later[-1].tracks) == 3
    assert not known & {track.id for track in later[-1].tracks}


def test_wrong_calls_are_refused() -> None:
    online = tracker()
    online.push(3, {})
    with pytest.raises(ValueError, match="frame 3 came after frame 3"):
        online.push(3, {})
    with pytest.raises(ValueError, match="no camera is called 'c9'; there are c0, c1, c2"):
        online.push(4, {"c9": Detections.empty(0)})
    with pytest.raises(ValueError, match="detection_probability is a probability between 0 and 1, not 1"):
        GroundSettings(detection_probability=1.0)
    with pytest.raises(ValueError, match="speed must be above 0, not -1"):
        GroundSettings(speed=-1.0)


def test_cameras_that_have_not_searched_say_nothing_about_who_is_there() -> None:
    walks = crossing_walks(3)
    frames = []
    for number, found in enumerate(detect_walkers(walks, VIEWS, FloorNoise())):
        frames.append(found if number < 15 or number % 2 else {"c0": found["c0"]})
    ids = true_ids(track_ground_plane(tracker(), enumerate(frames)), walks)
    assert all(len(found) == 1 for found in ids), ids


def test_frames_that_are_not_final_yet_show_the_same_people() -> None:
    walks, tracking = crossing_walks(3), tracker()
    provisional: dict[int, GroundFrame] = {}
    final: dict[int, GroundFrame] = {}
    for number, found in enumerate(detect_walkers(walks, VIEWS, FloorNoise())):
        done = tracking.push(number, found)
        final |= {frame.frame: frame for frame in done}
        if done:
            ahead = tracking.provisional()
            assert [frame.frame for frame in ahead] == list(range(done[-1].frame + 1, number + 1))
            provisional |= {frame.frame: frame for frame in ahead}
    for number in range(10, max(final)):
        places = {track.id: track.place for track in provisional[number].tracks}
        assert places.keys() == {track.id for track in final[number].tracks}
        for track in final[number].tracks:
            assert np.linalg.norm(places[track.id] - track.place) < 0.3


def test_a_camera_that_was_calibrated_anew_counts_by_its_new_homography() -> None:
    walks = crossing_walks(3)
    wrong = GroundCamera(np.diag([1.0, 1.0, 0.5]) @ CAMERAS["c2"].homography, 640.0, 480.0)
    tracking = tracker(CAMERAS | {"c2": wrong})
    tracking.set_camera("c2", CAMERAS["c2"])
    ids = true_ids(track_ground_plane(tracking, enumerate(detect_walkers(walks, VIEWS, FloorNoise()))), walks)
    assert all(len(found) == 1 for found in ids), ids
