"""The interactive tracker: equal to the online tracker without corrections; corrections revise the past."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from fakes.tracking.strolls import TEST_COSTS, WIDTH, WalkingPerson, detections_at, final_boxes, track_all
from tracking import Detections, OnlineTracker, WindowResult, WindowSettings, create_solver
from tracking.boxes import iou
from tracking.frame_rate import DEFAULT_FPS
from tracking.interactive import CorrectableTracker, InteractiveSettings, PositionCorrection
from tracking.interactive.late_correction import backdate_correction
from tracking.registry import create_tracker

SIMILAR = [WalkingPerson(0, 50, 4.0, 1), WalkingPerson(300, 50, -4.0, 1)]
"""Two similar people who cross in frame 37; only their motion distinguishes them."""


def _interactive_tracker(memory: int = 250) -> CorrectableTracker:
    assist = InteractiveSettings(enabled=True, memory_s=memory / DEFAULT_FPS)
    return CorrectableTracker(WindowSettings(), TEST_COSTS, create_solver("columns"), assist)


def _online_tracker() -> OnlineTracker:
    return OnlineTracker(WindowSettings(), TEST_COSTS, create_solver("columns"))


def _crossing(people: Sequence[WalkingPerson] = SIMILAR, frames: int = 80) -> list[Detections]:
    """Return the detections of a crossing: one box while one person is behind the other."""
    stream = [detections_at(people, n, 0.5, 1) for n in range(frames)]
    for n in range(33, 42):
        found = stream[n]
        stream[n] = Detections(found.boxes[:1], found.scores[:1], found.histograms[:1])
    return stream


def _at(person: WalkingPerson, frame: int, number: int) -> PositionCorrection:
    left, top, right, bottom = person.box(frame)
    return PositionCorrection(frame, number, (left + right) / 2, (top + bottom) / 2, WIDTH / 2)


def _boxes(result: WindowResult, number: int) -> np.ndarray:
    return next(track.boxes for track in result.tracks if track.id == number)


def _person_at(box: np.ndarray, frame: int) -> int:
    return int(np.argmax([iou(box, np.array(person.box(frame))) for person in SIMILAR]))


def _shown(results: Sequence[WindowResult]) -> list[object]:
    return [
        (
            result.first,
            result.last,
            result.final_to,
            [(t.id, t.boxes.tobytes(), t.interpolated.tobytes()) for t in result.tracks],
        )
        for result in results
    ]


def test_without_corrections_the_tracks_equal_those_of_the_online_tracker() -> None:
    stream = _crossing()
    results = track_all(stream, _interactive_tracker())
    assert _shown(results) == _shown(track_all(stream, _online_tracker()))
    assert all(result.revised_from is None for result in results)
    assert not any(result.risk_events for result in track_all(stream, _online_tracker()))


def test_only_a_crossing_of_similar_people_is_a_risk_event() -> None:
    def crossing_events(people: Sequence[WalkingPerson]) -> list[tuple[int, int]]:
        results = track_all(_crossing(people), _interactive_tracker())
        return [
            (result.last, event.frame)
            for result in results
            for event in result.risk_events
            if event.reason == "crossing"
        ]

    events = crossing_events(SIMILAR)
    assert events
    first, expected = events[0]
    assert first < 33
    assert expected == pytest.approx(37, abs=5)
    assert not crossing_events([SIMILAR[0], WalkingPerson(300, 50, -4.0, 4)])


def test_a_person_who_vanishes_alone_is_a_track_loss_event() -> None:
    gone = WalkingPerson(200, 50, 1.0, 2, seen=range(40))
    results = track_all(
        [detections_at([SIMILAR[0], gone], n, 0.5) for n in range(60)], _interactive_tracker()
    )
    losses = [event for result in results for event in result.risk_events if event.reason == "track_loss"]
    assert losses
    assert {event.objects for event in losses} == {(2,)}
    assert all(40 <= event.frame < 60 for event in losses)


@pytest.mark.parametrize(
    "frames", [range(42, 60), range(60, 61), range(75, 76)], ids=["following", "late", "last"]
)
def test_a_correction_revises_the_past_back_to_the_crossing(frames: range) -> None:
    """The corrections say that both turned back, which the tracker considers less likely."""
    tracked = _interactive_tracker()
    for n, seen in enumerate(_crossing()):
        tracked.push(n, seen)
    revised = tracked.apply_corrections([_at(SIMILAR[1], n, 1) for n in frames])
    assert revised is not None
    assert revised.last == 79
    assert revised.first <= 33
    assert revised.revised_from is not None
    assert 33 <= revised.revised_from <= 45
    for number, before, after in ((1, 0, 1), (2, 1, 0)):
        boxes = _boxes(revised, number)
        for frame in range(revised.first, 80):
            box = boxes[frame - revised.first]
            if not np.isnan(box[0]) and not 33 <= frame < 45:
                assert _person_at(box, frame) == (before if frame < 33 else after), (number, frame)
    assert {track.id for track in revised.tracks} == {1, 2}


def test_later_results_continue_from_the_revised_past() -> None:
    tracked, stream = _interactive_tracker(), _crossing(frames=100)
    for n, seen in enumerate(stream[:60]):
        tracked.push(n, seen)
    tracked.apply_corrections([_at(SIMILAR[1], n, 1) for n in range(42, 58)])
    later = [
        result for n, seen in enumerate(stream[60:], 60) if (result := tracked.push(n, seen)) is not None
    ]
    for frame, tracks in final_boxes(later).items():
        assert {number: _person_at(box, frame) for number, box in tracks.items()} == {1: 1, 2: 0}


def test_a_correction_that_agrees_with_the_tracks_changes_nothing() -> None:
    tracked = _interactive_tracker()
    for n, seen in enumerate(_crossing()):
        tracked.push(n, seen)
    assert tracked.apply_corrections([_at(SIMILAR[0], n, 1) for n in range(45, 79)]) is None


def test_a_correction_gives_a_lost_person_the_old_id_back() -> None:
    """Hidden for two seconds and back at an unexpected place: the tracker assigns a new id."""
    strolls = [
        WalkingPerson(0, 50, 2.0, 1, seen=range(30)),
        WalkingPerson(-100, 50, 5.0, 1, seen=range(80, 140)),
    ]
    tracked = _interactive_tracker()
    for n in range(140):
        tracked.push(n, detections_at(strolls, n, 0.5))
    revised = tracked.apply_corrections([_at(strolls[1], 120, 1)])
    assert revised is not None
    assert {track.id for track in revised.tracks if not np.isnan(track.boxes[-1, 0])} == {1}
    assert revised.revised_from == pytest.approx(80, abs=2)


def test_a_correction_before_the_memory_is_ignored() -> None:
    tracked = _interactive_tracker(memory=30)
    for n, seen in enumerate(_crossing()):
        tracked.push(n, seen)
    assert not tracked.remembers(40)
    assert tracked.remembers(49)
    assert tracked.apply_corrections([_at(SIMILAR[1], 40, 1)]) is None


def test_a_forgotten_contradiction_does_not_prevent_later_revisions() -> None:
    tracked, stream = _interactive_tracker(memory=60), _crossing(frames=91)
    for n, seen in enumerate(stream):
        tracked.push(n, seen)
        if n == 20:
            correction = _at(SIMILAR[0], 15, 1)
            assert tracked.apply_corrections([replace(correction, x=correction.x + 0.3**0.5 * WIDTH)]) is None
            assert tracked._contradicted_frames == [15]
    revised = tracked.apply_corrections([_at(SIMILAR[1], n, 1) for n in range(60, 70)])
    assert revised is not None
    assert revised.revised_from is not None


def test_the_memory_is_bounded() -> None:
    tracked = _interactive_tracker(memory=40)
    for n in range(300):
        tracked.push(n, detections_at(SIMILAR, n % 60, 0.5))
        tracked.apply_corrections([_at(SIMILAR[0], n % 60, 1)])
    memory = tracked._memory
    assert len(memory.detections) <= 40 + WindowSettings().resolve(25.0).window + 1
    assert len(memory.assignments) <= len(memory.detections)
    assert len(memory.snapshots) <= 40 // WindowSettings().resolve(25.0).stride + 2
    assert len(tracked._corrections) <= 41


def test_after_a_long_gap_nothing_before_it_is_remembered() -> None:
    tracked, stream = _interactive_tracker(), _crossing()
    for n, seen in enumerate(stream[:60]):
        tracked.push(n, seen)
    tracked.push(5000, stream[0])
    assert not tracked.remembers(50)
    assert tracked.remembers(5000)
    assert tracked.apply_corrections([_at(SIMILAR[1], 50, 1)]) is None


def test_the_same_corrections_give_the_same_results() -> None:
    def revised() -> list[object]:
        tracked = _interactive_tracker()
        results = [tracked.push(n, seen) for n, seen in enumerate(_crossing())]
        results += [
            tracked.apply_corrections([_at(SIMILAR[1], n, 1) for n in range(42, 60)]),
            tracked.flush(),
        ]
        return _shown([result for result in results if result is not None])

    assert revised() == revised()


def test_corrections_are_applied_after_the_end_of_a_recording() -> None:
    tracked = _interactive_tracker()
    for n, seen in enumerate(_crossing()):
        tracked.push(n, seen)
    tracked.flush()
    revised = tracked.apply_corrections([_at(SIMILAR[1], n, 1) for n in range(42, 60)])
    assert revised is not None
    assert revised.final_to == 79


@pytest.mark.parametrize(
    ("assist", "kind"),
    [
        (None, OnlineTracker),
        (InteractiveSettings(), OnlineTracker),
        (InteractiveSettings(enabled=True), CorrectableTracker),
    ],
)
def test_the_interactive_tracker_is_created_only_if_enabled(
    assist: InteractiveSettings | None, kind: Callable[..., object]
) -> None:
    found = create_tracker(
        "lp", WindowSettings(), TEST_COSTS, lambda: create_solver("columns"), assist=assist
    )
    assert type(found) is kind


@pytest.mark.parametrize(
    "wrong",
    [
        {"memory_s": 0},
        {"memory_s": 10**6},
        {"horizon_s": 0},
        {"horizon_s": 10**12},
        {"correction_weight": -1.0},
        {"hidden_share": 1.5},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must|at least|share"):
        InteractiveSettings(**wrong)  # type: ignore[arg-type]


def test_a_correction_inserts_a_box_where_the_detector_merges_two_people() -> None:
    tracked, stream = _interactive_tracker(), _crossing()
    merged = (33, 34, 35, 40, 41)
    for n in range(33, 42):
        both = np.array([person.box(n) for person in SIMILAR])
        box = np.concatenate([both[:, :2].min(axis=0), both[:, 2:].max(axis=0)])
        stream[n] = Detections(box[None], stream[n].scores, stream[n].histograms)
    shown = final_boxes(track_all(stream, _online_tracker()))
    assert not any(_is_own_box(shown[n].get(2), n) for n in merged), "the merged box is not the person's own"
    for n, seen in enumerate(stream):
        tracked.push(n, seen)
    revised = tracked.apply_corrections([_at(SIMILAR[1], n, 2) for n in range(30, 46)])
    assert revised is not None
    boxes = _boxes(revised, 2)
    assert all(_is_own_box(boxes[n - revised.first], n) for n in merged)
    assert {track.id for track in revised.tracks} == {1, 2}
    later = [tracked.push(n, detections_at(SIMILAR, n, 0.5)) for n in range(80, 100)]
    assert {track.id for result in later if result for track in result.tracks} == {1, 2}, (
        "inserted boxes initiate no track"
    )


def _is_own_box(box: np.ndarray | None, frame: int) -> bool:
    return box is not None and bool(iou(box, np.array(SIMILAR[1].box(frame))) > 0.7)


def test_a_correction_during_an_occlusion_is_not_backdated() -> None:
    """It says nothing about earlier frames; a correction at the other person's visible box does."""
    tracked = _interactive_tracker()
    for n, seen in enumerate(_crossing()):
        tracked.push(n, seen)
    behind, open_ = _at(SIMILAR[1], 38, 2), _at(SIMILAR[0], 60, 2)
    assert 2 not in tracked._memory.assignments[38]
    assert backdate_correction(behind, tracked._memory, TEST_COSTS, since=0) == []
    assert {
        correction.object for correction in backdate_correction(open_, tracked._memory, TEST_COSTS, since=0)
    } == {1, 2}
