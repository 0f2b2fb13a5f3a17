"""The online tracker: final frames do not change, people are found, and those who return keep their ids."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.strolls import WalkingPerson, detections_at, final_boxes, track_all, tracker
from fakes.tracking.windows import window_of_frames
from tracking.boxes import iou
from tracking.model.network import CostSettings, Network
from tracking.solvers import Solution, WarmStart, create_solver
from tracking.tracker import OnlineTracker
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings


def _equal(first: list[WindowResult], second: list[WindowResult]) -> bool:
    return [_shown(result) for result in first] == [_shown(result) for result in second]


def _shown(result: WindowResult) -> tuple[object, ...]:
    tracks = [(t.id, t.boxes.tobytes(), t.histogram.tobytes(), t.confidence) for t in result.tracks]
    return result.first, result.last, result.final_to, tracks, result.report


def _ids(results: list[WindowResult]) -> set[int]:
    return {number for boxes in final_boxes(results).values() for number in boxes}


@st.composite
def streams(draw: st.DrawFn) -> list[Detections]:
    """Draw detections of some people with misses, and some clutter."""
    people = [
        WalkingPerson(draw(st.integers(0, 300)), draw(st.integers(0, 100)), draw(st.integers(-4, 4)), kind)
        for kind in range(draw(st.integers(0, 3)))
    ]
    seed = draw(st.integers(0, 1000))
    rng = np.random.default_rng(seed)
    frames = []
    for frame in range(draw(st.integers(1, 45))):
        present = [person for person in people if rng.random() < 0.85]
        clutter = [
            WalkingPerson(float(rng.integers(0, 300)), 50.0, 0.0, 7) for _ in range(rng.integers(0, 2))
        ]
        frames.append(detections_at([*present, *clutter], frame, jitter=1.5, seed=seed))
    return frames


@given(streams(), st.integers(0, 20), st.sampled_from([(15, 5), (12, 4), (7, 7), (6, 1)]))
@settings(deadline=None, max_examples=25)
def test_every_frame_becomes_final_once_and_in_order(
    stream: list[Detections], start: int, size: tuple[int, int]
) -> None:
    settings = window_of_frames(*size)
    window, results = settings.resolve(25.0), track_all(stream, tracker(settings), start)
    assert results[0].first == start
    assert results[-1].final_to == start + len(stream) - 1
    for earlier, later in pairwise(results):
        assert later.first == earlier.final_to + 1
    for result in results:
        assert result.last >= result.final_to >= result.first - 1
        for track in result.tracks:
            assert track.boxes.shape == (result.last - result.first + 1, 4)
            assert not np.isnan(track.boxes).all()
            assert 0.0 <= track.confidence <= 1.0
        assert [track.id for track in result.tracks] == sorted({track.id for track in result.tracks})
    for result in results[:-1]:
        assert (result.last + 1) % window.stride == 0
        assert result.final_to == max(result.last - window.min_final_lag, result.first - 1)


@given(streams(), st.sets(st.integers(0, 44)))
@settings(deadline=None, max_examples=25)
def test_a_missed_frame_is_a_frame_without_detections(stream: list[Detections], missed: set[int]) -> None:
    emptied = [Detections.empty(8) if n in missed else seen for n, seen in enumerate(stream)]
    # The first and the last frame are kept, so that both trackers cover the same frames.
    kept = [n for n in range(len(stream)) if n not in missed or n in {0, len(stream) - 1}]
    pushed, skipping = tracker(), tracker()
    every = final_boxes(track_all(emptied, pushed))
    results = [skipping.push(n, emptied[n]) for n in kept] + [skipping.flush()]
    some = final_boxes([result for result in results if result is not None])
    assert every.keys() == some.keys()
    for frame, boxes in every.items():
        assert boxes.keys() == some[frame].keys()
        assert all(np.array_equal(box, some[frame][number]) for number, box in boxes.items())


@given(streams())
@settings(deadline=None, max_examples=10)
def test_trackers_share_no_state_and_are_deterministic(stream: list[Detections]) -> None:
    alone = track_all(stream, tracker())
    one, other = tracker(), tracker()
    noise = [detections_at([WalkingPerson(9.0, 9.0, 1.0, 5)], n) for n in range(len(stream))]
    results = []
    for n, seen in enumerate(stream):
        results.append(one.push(n, seen))
        other.push(n, noise[n])
    results.append(one.flush())
    assert _equal(alone, [result for result in results if result is not None])


@pytest.mark.parametrize("first", [0, 3, 1000])
def test_people_are_found_and_numbered_from_one(first: int) -> None:
    people = [WalkingPerson(20.0, 30.0, 2.0, 0), WalkingPerson(300.0, 60.0, -1.5, 3)]
    results = track_all([detections_at(people, n, 1.0) for n in range(40)], tracker(), first)
    found = final_boxes(results)
    # People present from the start are published from the first window that is long enough for initiation.
    assert min(found) < first + WindowSettings().resolve(25.0).stride
    assert sorted(found) == list(range(min(found), first + 40))
    for frame, boxes in found.items():
        assert sorted(boxes) == [1, 2]
        truth = {tuple(person.box(frame - first)) for person in people}
        for box in boxes.values():
            assert max(float(iou(box, np.array(real))) for real in truth) > 0.8


def test_a_person_who_enters_later_is_tracked_from_that_window_on() -> None:
    people = [WalkingPerson(20.0, 30.0, 2.0, 0), WalkingPerson(250.0, 60.0, -1.0, 3, range(30, 200))]
    results = track_all([detections_at(people, n, 1.0) for n in range(60)], tracker())
    found = final_boxes(results)
    seen = [frame for frame, boxes in found.items() if 2 in boxes]
    assert min(seen) <= 32
    assert seen == list(range(min(seen), 60))


def test_one_confident_detection_initiates_a_track_with_its_earlier_frames() -> None:
    vague = WalkingPerson(100.0, 50.0, 2.0, 1, sure=range(0))
    clear_once = WalkingPerson(100.0, 50.0, 2.0, 1, sure=range(12, 13))
    assert not _ids(track_all([detections_at([vague], frame) for frame in range(30)], tracker()))
    shown = final_boxes(track_all([detections_at([clear_once], frame) for frame in range(30)], tracker()))
    assert all(shown[frame].keys() == {1} for frame in range(30))


def test_short_clutter_initiates_no_track() -> None:
    person = WalkingPerson(20.0, 30.0, 2.0, 0)
    clutter = WalkingPerson(300.0, 60.0, 0.0, 5, range(22, 29))
    results = track_all([detections_at([person, clutter], n, 1.0) for n in range(60)], tracker())
    assert _ids(results) == {1}


def test_at_two_frames_a_second_who_passes_within_two_seconds_is_tracked() -> None:
    passing = WalkingPerson(20.0, 30.0, 20.0, 1, range(20, 24))
    slow = OnlineTracker(WindowSettings(), CostSettings(), create_solver("columns"), 2.0)
    found = final_boxes(track_all([detections_at([passing], frame, 1.0) for frame in range(40)], slow))
    assert [frame for frame, boxes in found.items() if boxes] == list(passing.seen)


def test_an_occluded_person_keeps_the_id() -> None:
    # They meet at frame 50; the further one is not detected while they overlap.
    front = WalkingPerson(100.0, 40.0, 2.0, 0)
    behind = WalkingPerson(300.0, 36.0, -2.0, 4)
    stream = []
    for frame in range(100):
        apart = abs(front.box(frame)[0] - behind.box(frame)[0]) > 25.0
        stream.append(detections_at([front, behind] if apart else [front], frame, 1.0))
    found = final_boxes(track_all(stream, tracker()))
    assert {number for boxes in found.values() for number in boxes} == {1, 2}
    before, after = found[30], found[90]
    of_front = {
        min(b, key=lambda k, b=b, f=f: abs(b[k][0] - front.box(f)[0])) for f, b in ((30, before), (90, after))
    }
    assert len(of_front) == 1
    assert sorted(after) == [1, 2]
    assert len(found[50]) == 1


def test_a_person_back_soon_keeps_the_id_and_one_back_late_gets_a_new_one() -> None:
    def ids(absence: int) -> set[int]:
        seen = [n for n in range(60 + absence) if n < 30 or n >= 30 + absence]
        stay = WalkingPerson(100.0, 40.0, 0.0, 2)
        stream = [detections_at([stay] if n in seen else [], n, 1.0) for n in range(60 + absence)]
        return _ids(track_all(stream, tracker(WindowSettings(forget_after_s=2.4))))

    assert ids(40) == {1}
    assert ids(80) == {1, 2}


def test_a_person_of_another_appearance_at_the_same_place_gets_a_new_id() -> None:
    first, second = (
        WalkingPerson(100.0, 40.0, 0.0, 2, range(30)),
        WalkingPerson(100.0, 40.0, 0.0, 6, range(70, 110)),
    )
    results = track_all([detections_at([first, second], n, 1.0) for n in range(110)], tracker())
    assert _ids(results) == {1, 2}


def test_two_boxes_on_one_person_are_one_object() -> None:
    twins = [WalkingPerson(50.0, 40.0, 1.0, 2), WalkingPerson(53.0, 42.0, 1.0, 2)]
    found = final_boxes(track_all([detections_at(twins, n, 1.0) for n in range(60)], tracker()))
    assert all(len(boxes) == 1 for boxes in found.values())


def test_after_a_long_gap_tracking_restarts_without_a_result_for_the_gap() -> None:
    person = WalkingPerson(50.0, 40.0, 0.0, 2)
    tracked = tracker()
    before = [tracked.push(n, detections_at([person], n)) for n in range(23)]
    ended = tracked.push(1_000_000_004, detections_at([person], 0))
    assert ended is not None
    assert ended.final_to == ended.last == 22
    after = [tracked.push(1_000_000_005 + n, detections_at([person], 0)) for n in range(30)]
    assert _ids([r for r in [*before, ended] if r is not None]) == {1}
    assert _ids([r for r in [*after, tracked.flush()] if r is not None]) == {2}


def test_memory_is_bounded_by_the_window_and_the_list() -> None:
    settings = WindowSettings(forget_after_s=1.2, max_objects=3)
    tracked, window = tracker(settings), settings.resolve(25.0)
    for n in range(600):
        people = [WalkingPerson(60.0 * k, 40.0, 0.0, (n // 40 + k) % 8) for k in range(5)]
        tracked.push(n, detections_at(people if n % 40 < 25 else [], n))
        assert len(tracked._detections) <= window.window + window.stride
        assert len(tracked._objects) <= window.max_objects


def test_at_max_objects_only_hidden_tracks_are_replaced() -> None:
    """One track is hidden and two people arrive at once: only one of them gets a track."""
    present = [WalkingPerson(100.0 * k, 40.0, 0.0, k) for k in range(4)]
    left = [WalkingPerson(100.0, 40.0, 0.0, 1, seen=range(20))]
    new = [WalkingPerson(100.0 * k, 240.0, 0.0, k, seen=range(40, 100)) for k in (5, 6)]
    people = [present[0], *left, *present[2:], *new]
    results = track_all(
        [detections_at(people, n) for n in range(100)], tracker(WindowSettings(max_objects=4))
    )
    assert {1, 3, 4} < set(final_boxes(results)[99])
    assert len(final_boxes(results)[99]) == 4


def test_a_person_detected_in_every_frame_is_initiated_at_full_required_visibility() -> None:
    person = WalkingPerson(20, 40, 2.0, 0)
    window = WindowSettings(birth_min_visible=1.0)
    results = track_all([detections_at([person], n) for n in range(40)], tracker(window))
    assert _ids(results) == {1}


def test_frame_numbers_must_grow() -> None:
    tracked = tracker()
    tracked.push(4, Detections.empty(8))
    with pytest.raises(ValueError, match="frame 4 came after frame 4"):
        tracked.push(4, Detections.empty(8))


def test_flush_without_frames_and_twice_gives_nothing() -> None:
    tracked = tracker()
    assert tracked.flush() is None
    tracked.push(0, Detections.empty(8))
    assert tracked.flush() is not None
    assert tracked.flush() is None
    assert tracked.push(4, Detections.empty(8)) is not None


@pytest.mark.parametrize(
    "wrong",
    [
        {"stride_s": 0.0},
        {"stride_s": 0.7},
        {"birth_s": 0.7},
        {"birth_min_visible": 0.0},
        {"max_objects": 0},
        {"min_frames": 2},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        WindowSettings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(("length", "stride"), [(1, 1), (2, 1), (3, 1), (3, 3)])
def test_the_shortest_windows_track_people(length: int, stride: int) -> None:
    tracked = tracker(window_of_frames(length, stride))
    results = track_all([detections_at([WalkingPerson(50, 50, 2, 0)], n) for n in range(20)], tracked)
    assert _ids(results) == {1}


@pytest.mark.parametrize(
    ("center", "place"), [((320.0, 180.0), (320.0, 180.0)), (None, (60.0, 70.0))], ids=["image", "unknown"]
)
def test_the_layout_term_places_hidden_people_at_the_center_of_the_image(
    center: tuple[float, float] | None, place: tuple[float, float]
) -> None:
    solved: list[Network] = []

    class Recorder:
        name = "recorder"

        def solve(self, network: Network, warm_start: WarmStart | None = None) -> Solution:
            solved.append(network)
            return create_solver("columns").solve(network, warm_start)

    standing = Detections(np.array([[50.0, 40.0, 70.0, 100.0]]), np.ones(1), np.empty((1, 0)))
    tracked = OnlineTracker(WindowSettings(), CostSettings(), Recorder(), center=center)
    for frame in range(15):
        tracked.push(frame, standing)
    assert {tuple(hidden) for hidden in solved[-1].locations[0, :, -1].tolist()} == {(*place, *place)}


def test_two_people_who_cross_without_appearance_keep_their_ids() -> None:
    """Only their motion distinguishes them; for a few frames one occludes the other."""
    tracked = tracker()
    results = []
    for frame in range(60):
        lefts = [100.0 + 4.0 * frame, 340.0 - 4.0 * frame]
        shown = lefts[:1] if 28 <= frame <= 31 else lefts
        boxes = np.array([[left, 50.0, left + 40.0, 170.0] for left in shown])
        results.append(tracked.push(frame, Detections(boxes, np.ones(len(boxes)), np.empty((len(boxes), 0)))))
    results.append(tracked.flush())
    found = final_boxes([result for result in results if result is not None])
    assert _ids([result for result in results if result is not None]) == {1, 2}
    first, last = found[20], found[59]
    for number, box in first.items():
        went_right = box[0] == pytest.approx(100.0 + 4.0 * 20)
        assert (last[number][0] > box[0]) == went_right


def test_a_new_person_does_not_get_the_id_of_one_who_left_elsewhere() -> None:
    first, second = (
        WalkingPerson(20.0, 40.0, 0.0, 2, range(30)),
        WalkingPerson(220.0, 40.0, 0.0, 2, range(45, 90)),
    )
    results = track_all([detections_at([first, second], n, 1.0) for n in range(90)], tracker())
    assert _ids(results) == {1, 2}


def test_a_person_back_elsewhere_after_long_is_reidentified_by_appearance() -> None:
    away = 120
    present = WalkingPerson(20.0, 40.0, 0.0, 2, range(40))
    back = WalkingPerson(260.0, 60.0, 0.0, 2, range(40 + away, 100 + away))
    results = track_all([detections_at([present, back], n, 1.0) for n in range(100 + away)], tracker())
    assert _ids(results) == {1}
    assert set(final_boxes(results)[90 + away]) == {1}
