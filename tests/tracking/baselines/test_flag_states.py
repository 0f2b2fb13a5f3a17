"""The thesis's state machine: all transitions, and clips in which two people meet."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from fakes.tracking.strolls import HEIGHT, WIDTH
from fakes.tracking.windows import window_of_frames
from tracking import Detections
from tracking.baselines.flag_states.machine import ComponentView, FlagState, next_state
from tracking.baselines.flag_states.tracker import FlagStateSettings, FlagStatesTracker
from tracking.types import RiskEvent

_S = FlagState
_AREAS = (None, 40.0, 79.0, 80.0, 99.0, 100.0, 150.0)


def _allowed(state: FlagState, view: ComponentView) -> FlagState:
    """Return the next state by the list of transitions in section 8.2, for a neighbor of area 100 or none."""
    goes = {
        _S.CLOSE_FLAGGED: (_S.OCCLUDED_FLAGGED, view.merged),
        _S.CLOSE_UNFLAGGED: (_S.OCCLUDED_UNFLAGGED, view.merged),
        _S.OCCLUDED_FLAGGED: (_S.CLOSE_FLAGGED, view.split),
        _S.OCCLUDED_UNFLAGGED: (_S.CLOSE_UNFLAGGED, view.split),
        _S.FAIL_COLOR: (_S.OK, view.area is not None),
    }
    if state in goes:
        after, happens = goes[state]
        if happens:
            return after
        return _S.OK if state.is_close and view.neighbor_area is None else state
    if view.area is None:
        return _S.FAIL_COLOR
    if view.neighbor_area is None or view.area >= 100.0:
        return _S.OK
    return _S.CLOSE_UNFLAGGED if view.area / 100.0 < 0.8 else _S.CLOSE_FLAGGED


def test_all_transitions_are_those_of_the_thesis() -> None:
    flags = (False, True)
    for state, area, near, merged, split in product(_S, _AREAS, (None, 100.0), flags, flags):
        view = ComponentView(area, near, merged=merged, split=split)
        assert next_state(state, view, 0.8) is _allowed(state, view), (state, view)


def _meeting(second_height: float) -> list[Detections]:
    """Return boxes of a person who stands, and of one of another height who walks past, merged while near."""
    frames = []
    for frame in range(110):
        left = 20.0 + 3.0 * frame
        standing = [200.0, 50.0, 200.0 + WIDTH, 50.0 + HEIGHT]
        walking = [left, 50.0 + HEIGHT - second_height, left + WIDTH, 50.0 + HEIGHT]
        boxes = [standing, walking]
        if abs(left - 200.0) < WIDTH:
            both = np.array(boxes)
            boxes = [[*both[:, :2].min(axis=0), *both[:, 2:].max(axis=0)]]
        frames.append(Detections(np.array(boxes), np.full(len(boxes), 0.9), np.empty((len(boxes), 0))))
    return frames


def _follow(frames: list[Detections]) -> tuple[dict[int, dict[int, np.ndarray]], list[RiskEvent]]:
    tracker = FlagStatesTracker(window_of_frames(6, 3))
    pushed = [tracker.push(frame, seen) for frame, seen in enumerate(frames)]
    shown: dict[int, dict[int, np.ndarray]] = {}
    events: list[RiskEvent] = []
    for result in (*pushed, tracker.flush()):
        if result is None:
            continue
        events += result.risk_events
        for track in result.tracks:
            for offset, box in enumerate(track.boxes):
                if not np.isnan(box[0]):
                    shown.setdefault(result.first + offset, {})[track.id] = box
    return shown, events


def test_people_of_different_sizes_keep_their_ids_and_are_not_flagged() -> None:
    shown, events = _follow(_meeting(second_height=60.0))
    assert [event for event in events if event.reason == "crossing"] == []
    first, last = shown[20], shown[105]
    assert set(first) == set(last) == {1, 2}
    for number in (1, 2):
        heights = [boxes[number][3] - boxes[number][1] for boxes in (first, last)]
        assert heights[0] == pytest.approx(heights[1], abs=5.0)


def test_equally_large_people_who_come_close_raise_a_flag_before_they_merge() -> None:
    _, events = _follow(_meeting(second_height=HEIGHT - 3.0))
    crossings = [event for event in events if event.reason == "crossing"]
    assert crossings
    assert set(crossings[0].objects) == {1, 2}
    assert crossings[0].frame < (200.0 - WIDTH - 20.0) / 3.0 + 1


def test_a_person_without_a_component_is_flagged_as_lost() -> None:
    alone = Detections(np.array([[20.0, 50.0, 50.0, 140.0]]), np.array([0.9]), np.empty((1, 0)))
    shown, events = _follow([*[alone] * 20, *[Detections.empty(0)] * 4, *[alone] * 20])
    assert [(event.reason, event.objects, event.frame) for event in events] == [("track_loss", (1,), 20)]
    assert set(shown[40]) == {1}


@pytest.mark.parametrize(
    "wrong", [{"margin_heights": -1.0}, {"max_size_ratio": 1.5}, {"min_merge_ratio": 1.0}]
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must be"):
        FlagStateSettings(**wrong)
