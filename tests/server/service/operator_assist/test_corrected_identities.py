"""After an operator's position correction the numbers follow the right people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from bestview import IdentitySettings, Split
from server.camera.operator_corrections import merge_correction
from server.camera.track_messages import TrackMessageBuilder
from server.messaging.messages import CameraTracks
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.operator_assist.operator_assist import MarkedPosition, corrections_for_tracker
from tracking import CostSettings, Detections, WindowSettings, create_solver
from tracking.interactive import CorrectableTracker, InteractiveSettings, PositionCorrection

WIDTH, HEIGHT = 640, 360
WINDOW = WindowSettings().resolve(25.0)
ASSIST = InteractiveSettings(enabled=True)
MET = 60
"""The frame in which two people of the same appearance meet and turn back."""
FRAMES = 150


def places(frame: int) -> list[float]:
    """Return the left edges of the boxes of two people who meet and turn back."""
    distance = 4.0 * abs(frame - MET)
    return [300.0 - distance, 300.0 + distance]


def detections_in(frame: int) -> Detections:
    left = np.clip(np.array(places(frame)), 0, WIDTH - 40)
    boxes = np.stack([left, np.full(2, 100.0), left + 40.0, np.full(2, 220.0)], axis=1)
    if abs(frame - MET) < 6:
        boxes = boxes[:1]  # one occludes the other
    histograms = np.full((len(boxes), 4), 0.25)
    return Detections(boxes, np.ones(len(boxes)), histograms)


class Camera:
    """One camera's tracker and its messages."""

    def __init__(self) -> None:
        solver = create_solver("columns")
        self._tracker = CorrectableTracker(WINDOW, CostSettings(), solver, ASSIST)
        self._reporter = TrackMessageBuilder("c0", 1, (WIDTH, HEIGHT), WINDOW.stride)

    def take(self, frame: int, marked: Sequence[PositionCorrection] = ()) -> CameraTracks | None:
        result = self._tracker.push(frame, detections_in(frame))
        if result is None:
            return None
        revised = self._tracker.apply_corrections(marked) if marked else None
        return self._reporter.regular(result if revised is None else merge_correction(result, revised))


def at(people: PersonTracker, pulse: int) -> dict[int, float]:
    """Return the left edge of each person's box, by number."""
    [rows] = people.boxes("c0", pulse, 1)
    return {number: left for number, left, *_ in rows}


def run_meeting(
    corrected_at: int, pulses: Sequence[int], *, late: bool = False, frames: int = FRAMES
) -> tuple[PersonTracker, dict[int, dict[int, float]]]:
    """Simulate the meeting, with a correction at a window's end of the first person's positions.

    Returns:
        The person tracker, and by pulse the published positions of people.
    """
    people = PersonTracker(IdentitySettings(), ["c0"], {"c0": None}, (WIDTH, HEIGHT), WINDOW.min_final_lag)
    people.published.frames = ASSIST.resolve(25.0).memory_frames
    camera, positions, first = Camera(), {}, 0
    pending: list[CameraTracks] = []
    for frame in range(frames):
        marked: list[PositionCorrection] = []
        if frame == corrected_at:
            [left] = [number for number, edge in positions[20].items() if edge < 300]
            request = corrections_for_tracker(
                people,
                "c0",
                left,
                [MarkedPosition(pulse, places(pulse)[0] + 20, 160, 10) for pulse in pulses],
            )
            assert request is not None
            marked = [
                PositionCorrection(
                    correction.pulse, correction.track, correction.x, correction.y, correction.tolerance
                )
                for correction in request.corrections
            ]
        message = camera.take(frame, marked)
        if message is None:
            continue
        assert (message.revised_from is not None) == bool(marked), "only corrections revise the past"
        missed = late and bool(marked)
        tracks, late_messages = {} if missed else {"c0": message}, tuple(pending)
        pending = [message] if missed else []
        people.update(Epoch(message.epoch, frame, tracks, late_revisions=late_messages))
        for pulse in range(first, frame - 19):
            positions[pulse] = at(people, pulse)
        first = max(first, frame - 19)
        people.forget_before(first)
    return people, positions


def sides(positions: dict[int, dict[int, float]], pulse: int) -> list[int]:
    """Return the numbers from left to right."""
    return sorted(positions[pulse], key=positions[pulse].__getitem__)


def test_similar_people_who_meet_and_turn_back_are_confused() -> None:
    people, positions = run_meeting(corrected_at=-1, pulses=[])
    assert sides(positions, 30) == list(reversed(sides(positions, 110)))
    assert people.take_corrections() == ()


@pytest.mark.parametrize("late", [False, True], ids=["in time", "too late for its epoch"])
@pytest.mark.parametrize("corrected_at", [84, 99, 124])
def test_numbers_follow_a_correction_in_later_frames(corrected_at: int, *, late: bool) -> None:
    people, positions = run_meeting(corrected_at, range(MET + 8, MET + 14), late=late)
    left, right = sides(positions, 30)
    behind = WINDOW.stride if late else 0
    if corrected_at - 20 > MET + 10:
        assert sides(positions, corrected_at - 20 - WINDOW.stride) == [right, left], "published frames stay"
    for pulse in range(max(corrected_at - 19 + behind, MET + 10), FRAMES - 20):
        assert sides(positions, pulse) == [left, right]
    splits, expected = people.take_corrections(), (Split(left, right, "c0"), Split(right, left, "c0"))
    assert splits == expected or (splits == () and corrected_at == 84), (
        "soon after the meeting no wrong number was published"
    )


@pytest.mark.parametrize("corrected_at", [249, 299])
def test_numbers_follow_a_correction_of_the_distant_past(corrected_at: int) -> None:
    """The frames of the meeting are settled, but their tracks are still remembered."""
    frames = corrected_at + 51
    people, positions = run_meeting(corrected_at, range(MET + 8, MET + 14), frames=frames)
    left, right = sides(positions, 30)
    assert sides(positions, corrected_at - 20 - WINDOW.stride) == [right, left]
    for pulse in range(corrected_at - 19, frames - 20):
        assert sides(positions, pulse) == [left, right]
    assert people.take_corrections() == (Split(left, right, "c0"), Split(right, left, "c0"))


def test_points_after_a_correction_still_refer_to_the_same_person() -> None:
    people, positions = run_meeting(99, range(MET + 8, MET + 14))
    left, right = sides(positions, 30)
    before, after = (people.published.latest_track("c0", [left], pulse) for pulse in (40, 120))
    assert before is not None
    assert after is not None
    assert before.track == after.track, "the track id stays with the person"
    assert corrections_for_tracker(people, "c0", left, [MarkedPosition(-1, 0, 0, 1)]) is None
    assert corrections_for_tracker(people, "c0", 99, [MarkedPosition(120, 0, 0, 1)]) is None
    assert corrections_for_tracker(people, "c1", left, [MarkedPosition(120, 0, 0, 1)]) is None
    assert right != left
