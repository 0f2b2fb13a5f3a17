"""Two people who are taken for each other when they meet have their own ids again after they have parted."""

from __future__ import annotations

import numpy as np
import pytest

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking import Detections, create_solver
from tracking.boxes import Floats
from tracking.ground_plane import (
    GroundFrame,
    GroundPlaneTracker,
    GroundSettings,
    GroundTrack,
    track_ground_plane,
)
from tracking.ground_plane.between_keyframes import Keyframe, frames_until
from tracking.ground_plane.exchanges import ClearSighting, ExchangeMonitor, PersonInFrame

VIEWS = floor_views()
CAMERAS = {name: view.camera for name, view in VIEWS.items()}
FPS = 5.0
RED, BLUE, GREEN = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.1, 0.8]), np.array([0.1, 0.8, 0.1])
PINK = 0.97 * RED + 0.03 * BLUE
"""Hardly another color than red."""


def seen(number: int, place: float, looks: Floats | None, camera: int = 0) -> PersonInFrame:
    return PersonInFrame(
        number, np.array([place, 0.0]), [ClearSighting(camera, looks)] if looks is not None else []
    )


class Meeting:
    """Two people, 1 and 2, in a monitor of frames at 10 per second."""

    def __init__(self) -> None:
        self.monitor = ExchangeMonitor(0.1)

    def frames(
        self, seconds: float, apart: float, first: Floats | None, second: Floats | None, camera: int = 0
    ) -> list[tuple[int, int]]:
        """Add frames; return the exchanges found. None: nobody sees the person."""
        people = [seen(1, 0.0, first, camera), seen(2, apart, second, camera)]
        return [pair for _ in range(round(10 * seconds)) for pair in self.monitor.update(people, (1, 2))]


@pytest.fixture
def met() -> Meeting:
    """Return red and blue, who have been near each other for a second."""
    meeting = Meeting()
    assert meeting.frames(3.0, 5.0, RED, BLUE) == []
    assert meeting.frames(1.0, 1.0, 0.5 * (RED + BLUE), 0.5 * (RED + BLUE)) == []
    return meeting


def test_who_looks_like_the_other_after_parting_was_exchanged_once(met: Meeting) -> None:
    assert met.frames(0.8, 3.0, BLUE, RED) == [], "too early to say"
    assert met.frames(1.0, 3.0, BLUE, RED) == [(1, 2)]
    assert met.frames(9.0, 3.0, RED, BLUE) == [], "from then on their ids are their own"


def test_who_looks_as_before_was_not(met: Meeting) -> None:
    assert met.frames(9.0, 3.0, RED, BLUE) == []


@pytest.mark.parametrize("looks", [(GREEN, GREEN), (None, RED), (BLUE, None), (np.zeros(0), RED)])
def test_what_says_nothing_about_both_exchanges_nobody(met: Meeting, looks: tuple[Floats, Floats]) -> None:
    assert met.frames(9.0, 3.0, *looks) == []


def test_people_who_look_alike_are_not_exchanged() -> None:
    meeting = Meeting()
    assert meeting.frames(3.0, 5.0, RED, PINK) == []
    assert meeting.frames(1.0, 1.0, RED, PINK) == []
    assert meeting.frames(9.0, 3.0, PINK, RED) == []


def test_light_that_changes_while_they_meet_exchanges_nobody(met: Meeting) -> None:
    assert met.frames(9.0, 3.0, 0.6 * RED + 0.4 * GREEN, 0.6 * BLUE + 0.4 * GREEN) == []


def test_looks_in_another_camera_than_before_say_nothing(met: Meeting) -> None:
    assert met.frames(9.0, 3.0, BLUE, RED, camera=1) == []


def test_who_meets_again_before_it_is_known_is_compared_with_the_looks_before_the_first_time(
    met: Meeting,
) -> None:
    assert met.frames(0.5, 3.0, BLUE, RED) == []
    assert met.frames(1.0, 1.0, BLUE, RED) == []
    assert met.frames(2.0, 3.0, BLUE, RED) == [(1, 2)]


def test_an_exchange_begins_the_comparison_with_others_anew() -> None:
    """Two of three who met were exchanged: what was seen of them before says nothing about the third."""
    monitor, looks = ExchangeMonitor(0.1), (RED, BLUE, GREEN)

    def exchanges(frames: int, places: tuple[float, ...], looks: tuple[Floats, ...]) -> list[tuple[int, int]]:
        people = [seen(k + 1, *each) for k, each in enumerate(zip(places, looks, strict=True))]
        return [pair for _ in range(frames) for pair in monitor.update(people, (1, 2, 3))]

    assert exchanges(30, (0.0, 5.0, 10.0), looks) == []
    assert exchanges(5, (0.0, 0.8, 1.6), looks) == []
    assert exchanges(11, (0.0, 5.0, 10.0), (BLUE, RED, GREEN)) == [(1, 2)]
    assert exchanges(90, (5.0, 0.0, 10.0), looks) == []


def test_somebody_who_is_hidden_after_they_met_is_compared_when_they_are_seen_again(met: Meeting) -> None:
    for _ in range(10):
        assert met.monitor.update([seen(2, 3.0, RED)], (1, 2)) == []
    assert met.frames(1.5, 3.0, BLUE, RED) == [(1, 2)]


def test_somebody_who_has_left_is_forgotten(met: Meeting) -> None:
    met.monitor.update([], [])
    assert met.frames(9.0, 3.0, BLUE, RED) == []


def with_looks(found: Detections, looks: list[Floats]) -> Detections:
    return Detections(found.boxes, found.scores, np.array(looks))


def bounce() -> tuple[Floats, list[dict[str, Detections]]]:
    """Return two people who walk up to each other and back again, (F, 2, 2), and their detections.

    They look alike while they are near each other, so that they seem to have passed each other.
    """
    seconds = np.arange(round(12.0 * FPS))[:, None] / FPS
    apart = 0.3 + np.abs(seconds - 5.0) * 1.2
    walks = 5.0 + 0.5 * np.concatenate([-apart, apart], axis=1)[..., None] * np.array([1.0, 0.2])
    found = detect_walkers(walks, VIEWS, FloorNoise(deviation=0.005))
    for frame, part in enumerate(found):
        mixed = abs(frame / FPS - 5.0) < 1.4
        looks = [0.5 * (RED + BLUE)] * 2 if mixed else [RED, BLUE]
        for name in part:
            part[name] = with_looks(part[name], looks)
    return walks, found


def numbers(frame: GroundFrame, walks: Floats) -> list[int]:
    """Return the ids of the tracks nearest to each person."""
    places = np.array([track.place for track in frame.tracks])
    nearest = np.linalg.norm(places[None] - walks[frame.frame][:, None], axis=2).argmin(axis=1)
    return [frame.tracks[k].id for k in nearest.tolist()]


def test_people_who_turned_back_when_they_met_have_their_own_ids_again() -> None:
    walks, found = bounce()
    tracker = GroundPlaneTracker(CAMERAS, GroundSettings(), create_solver("columns"), FPS)
    frames = track_ground_plane(tracker, enumerate(found))
    before, between, after = (numbers(frames[round(s * FPS)], walks) for s in (3.0, 6.4, 10.0))
    assert between == before[::-1], "the program takes them for each other"
    assert after == before


def test_between_keyframes_people_walk_on_though_their_ids_are_exchanged() -> None:
    def people(places: dict[int, Floats]) -> tuple[GroundTrack, ...]:
        return tuple(GroundTrack(number, place, np.eye(2), {}) for number, place in places.items())

    one, two = np.array([1.0, 0.0]), np.array([9.0, 0.0])
    step = np.array([0.0, 0.2])
    previous = Keyframe(2, GroundFrame(0, people({1: one, 2: two}), None), {})
    exchanged = GroundFrame(1, people({1: two + step, 2: one + step}), None, {1: 2, 2: 1})
    frame = frames_until(Keyframe(4, exchanged, {}), previous, 3, {})[0]
    assert {track.id: track.place.tolist() for track in frame.tracks} == {1: [9.0, 0.1], 2: [1.0, 0.1]}
