"""The temporal-consistency tracker: ids survive merges, people enter and leave, frames are published once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fakes.tracking.strolls import final_boxes
from fakes.tracking.windows import window_of_frames
from tracking import CostSettings, Detections, WindowResult, create_solver
from tracking.baselines.temporal_consistency import BlobSettings, TemporalSettings
from tracking.baselines.temporal_consistency.blobs import BlobDetector
from tracking.baselines.temporal_consistency.tracker import TemporalBlobTracker
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image
from tracking.registry import create_tracker, needs_images

SIZE = (150, 200)
_HALF = 11
_COLORS = ((40, 40, 200), (200, 70, 30), (50, 160, 50))
SETTINGS = TemporalSettings(window_stages=4, stage_s=0.2, forget_after_s=2.0)
FPS = 25.0
WINDOW = window_of_frames(10, 5, fps=FPS)
_NO_DETECTIONS: Detections = Detections.empty(0)


def _picture(middles: dict[int, tuple[float, float]], seed: int) -> Image:
    rng = np.random.default_rng(seed)
    image = np.clip(120 + rng.normal(0, 3, (*SIZE, 3)), 0, 255).astype(np.uint8)
    for person, (x, y) in middles.items():
        left, top = round(x) - _HALF, round(y) - _HALF
        if left < SIZE[1] and left + 2 * _HALF > 0:
            image[max(top, 0) : top + 2 * _HALF, max(left, 0) : left + 2 * _HALF] = _COLORS[person]
    return image


def _meet(frame: int) -> dict[int, tuple[float, float]]:
    """Return the positions of two people who meet, stand together, and walk back."""
    away = 60.0 - 1.2 * min(frame, 40) if frame < 70 else 12.0 + 1.2 * min(frame - 70, 40)
    return {0: (100.0 - away, 75.0), 1: (100.0 + away, 75.0)}


def _tracker(settings: TemporalSettings = SETTINGS) -> TemporalBlobTracker:
    tracker = TemporalBlobTracker(WINDOW, settings, FPS)
    tracker.prepare(_picture({}, seed) for seed in range(1000, 1020))
    return tracker


def _follow(tracker: TemporalBlobTracker, pictures: dict[int, Image | None]) -> list[WindowResult]:
    results = [tracker.push(frame, _NO_DETECTIONS, image) for frame, image in pictures.items()]
    return [result for result in (*results, tracker.flush()) if result is not None]


def _nearest(boxes: dict[int, Floats], place: tuple[float, float]) -> int:
    box = np.array([place[0] - _HALF, place[1] - _HALF, place[0] + _HALF, place[1] + _HALF])
    return max(boxes, key=lambda number: float(iou(boxes[number], box)))


def test_people_who_meet_and_part_keep_their_ids() -> None:
    results = _follow(_tracker(), {frame: _picture(_meet(frame), frame) for frame in range(130)})
    boxes = final_boxes(results)
    numbers = [tuple(_nearest(boxes[frame], _meet(frame)[person]) for person in (0, 1)) for frame in (5, 125)]
    assert numbers[0] == numbers[1]
    assert set(numbers[0]) == {1, 2}
    middle = boxes[55]
    assert np.array_equal(middle[1], middle[2]), "both have the box of the merged blob"


def test_boxes_follow_the_blobs_between_the_samples() -> None:
    results = _follow(_tracker(), {frame: _picture(_meet(frame), frame) for frame in range(40)})
    boxes = final_boxes(results)
    for frame in range(20):
        x, y = _meet(frame)[0]
        expected = np.array([x - _HALF, y - _HALF, x + _HALF, y + _HALF])
        assert float(iou(boxes[frame][_nearest(boxes[frame], (x, y))], expected)) > 0.6, f"frame {frame}"


def test_a_person_who_enters_gets_an_id_and_one_who_leaves_loses_it() -> None:
    def where(frame: int) -> dict[int, tuple[float, float]]:
        found = {0: (60.0, 40.0)}
        if frame >= 30:
            found[1] = (-15.0 + 2.0 * (frame - 30), 110.0)
        return found

    frames = range(230)
    boxes = final_boxes(_follow(_tracker(), {frame: _picture(where(frame), frame) for frame in frames}))
    assert set(boxes[20]) == {1}
    assert set(boxes[90]) == {1, 2}
    assert set(boxes[225]) == {1}


def test_in_a_closed_world_no_track_is_initiated_later() -> None:
    def where(frame: int) -> dict[int, tuple[float, float]]:
        return {0: (60.0, 40.0)} | ({1: (140.0, 110.0)} if frame >= 30 else {})

    tracker = _tracker(TemporalSettings(window_stages=4, stage_s=0.2, closed_world=True))
    boxes = final_boxes(_follow(tracker, {frame: _picture(where(frame), frame) for frame in range(90)}))
    assert {number for row in boxes.values() for number in row} == {1}


def test_every_frame_is_published_once_within_the_lag() -> None:
    pictures: dict[int, Image | None] = {frame: _picture(_meet(frame), frame) for frame in range(3, 120)}
    for frame in (10, 11, *range(60, 90)):
        pictures[frame] = None
    for frame in (30, 31, 44):
        del pictures[frame]
    results = _follow(_tracker(), pictures)
    assert results[0].first == 3
    assert results[-1].final_to == 119
    for earlier, later in pairwise(results):
        assert later.first == earlier.final_to + 1
    lag = SETTINGS.max_final_lag(FPS)
    for result in results:
        assert result.last - result.final_to <= lag
        for track in result.tracks:
            assert track.boxes.shape == (result.last - result.first + 1, 4)
            assert not np.isnan(track.boxes).all()
            assert np.nanmin(track.boxes[:, 2:] - track.boxes[:, :2]) > 0


def test_results_come_when_windows_end() -> None:
    results = _follow(_tracker(), {frame: _picture(_meet(frame), frame) for frame in range(52)})
    assert [result.last for result in results] == [*range(4, 50, 5), 51]


def test_the_same_pictures_give_the_same_tracks() -> None:
    pictures: dict[int, Image | None] = {frame: _picture(_meet(frame), frame) for frame in range(60)}
    first, second = (
        [track.boxes.tobytes() for result in _follow(_tracker(), pictures) for track in result.tracks]
        for _ in range(2)
    )
    assert first == second


def test_ids_are_new_after_a_long_gap_and_no_result_spans_it() -> None:
    tracker, later = _tracker(), WINDOW.resolve(FPS).forget_after + 40
    before = _follow(tracker, {frame: _picture(_meet(0), frame) for frame in range(20)})
    after = _follow(tracker, {later + frame: _picture(_meet(0), frame) for frame in range(20)})
    assert after[0].first == later
    numbers = [{track.id for result in results for track in result.tracks} for results in (before, after)]
    assert numbers == [{1, 2}, {3, 4}]


def test_without_preparation_the_background_is_learned_online() -> None:
    settings = TemporalSettings(
        window_stages=2, stage_s=0.2, blobs=BlobSettings(bootstrap_s=20 / FPS, samples=10)
    )
    tracker = TemporalBlobTracker(WINDOW, settings, FPS)
    pictures = {frame: _picture({} if frame < 20 else {0: (60.0, 40.0)}, frame) for frame in range(60)}
    boxes = final_boxes(_follow(tracker, pictures))
    assert not any(boxes.get(frame) for frame in range(20))
    assert set(boxes[55]) == {1}


def test_appearance_histograms_come_from_detections_of_single_people() -> None:
    tracker = _tracker()
    pushed = []
    for frame in range(40):
        middles = _meet(frame)
        boxes = np.array([[x - _HALF, y - _HALF, x + _HALF, y + _HALF] for x, y in middles.values()])
        detections = Detections(boxes, np.full(2, 0.9), np.eye(2))
        pushed.append(tracker.push(frame, detections, _picture(middles, frame)))
    results = [result for result in (*pushed, tracker.flush()) if result is not None]
    samples = [
        (track.id, sample)
        for result in results
        for track in result.tracks
        for sample in track.appearance_histograms
    ]
    assert {(number, int(sample.histogram.argmax())) for number, sample in samples} == {(1, 0), (2, 1)}


def test_a_frame_that_does_not_come_after_the_last_one_is_refused() -> None:
    tracker = _tracker()
    tracker.push(5, _NO_DETECTIONS, _picture({}, 0))
    with pytest.raises(ValueError, match="frame 5 came after frame 5"):
        tracker.push(5, _NO_DETECTIONS, _picture({}, 0))


def test_the_registry_creates_it_by_name_with_pictures_required() -> None:
    assert needs_images("temporal")
    created = create_tracker(
        "temporal", WINDOW, CostSettings(), lambda: create_solver("columns"), SETTINGS, FPS
    )
    assert isinstance(created, TemporalBlobTracker)


@pytest.mark.parametrize(
    "wrong",
    [
        {"window_stages": 0},
        {"window_stages": 10**9},
        {"stage_s": 0.0},
        {"stage_s": float("inf")},
        {"stage_s": float("nan")},
        {"appearance_regions": 4},
        {"prune_factor": 0.5},
        {"max_people": 0},
        {"merge_cost": -0.1},
        {"inner_exit_cost": float("nan")},
        {"forget_after_s": -1.0},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must (not )?be"):
        TemporalSettings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"dilation_m": -0.1},
        {"dilation_m": 2.0},
        {"min_area_m2": -1.0},
        {"samples": 10**9},
        {"learn_s": 0.0},
    ],
)
def test_invalid_blob_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must be|is a share"):
        BlobSettings(**wrong)  # type: ignore[arg-type]


def test_the_dilation_is_bounded_by_the_picture() -> None:
    blobs = BlobDetector((64, 48), 0.001, BlobSettings(dilation_m=1.0))
    assert blobs._kernel.shape == (13, 13)
